"""Identifies a state space with SIPPY (sippy_unipi) and prints one JSON object.

Usage: sippy_subspace.py DATA.csv METHOD ORDER HORIZON PERIOD INPUTS FREQUENCY...
DATA.csv holds the inputs, then one output, without a header.
"""
import json
import sys
import time

import numpy as np
from sippy_unipi import system_identification

data = np.loadtxt(sys.argv[1], delimiter=",")
method, order, horizon = sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
period, inputs = float(sys.argv[5]), int(sys.argv[6])
frequencies = [float(text) for text in sys.argv[7:]]
data = data - data.mean(axis=0)
u, y = data[:, :inputs].T, data[:, inputs:].T
started = time.perf_counter()
model = system_identification(
    y, u, method, SS_fixed_order=order, SS_f=horizon, SS_p=horizon, SS_D_required=False, tsample=period
)
seconds = time.perf_counter() - started
responses = []
for frequency in frequencies:
    z = np.exp(2j * np.pi * frequency * period)
    g = model.C @ np.linalg.solve(z * np.eye(order) - model.A, model.B) + model.D
    responses.append([[float(v.real), float(v.imag)] for v in np.asarray(g)[0]])
print("RESULT " + json.dumps({"seconds": seconds, "responses": responses}))

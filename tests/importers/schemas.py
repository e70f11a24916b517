"""Every FMU's descriptions against the schemas of the standard, which fmpy brings."""

import io
import sys
import zipfile
from pathlib import Path

import fmpy
from lxml import etree

SCHEMAS = Path(fmpy.__file__).parent / "schema"
FILES = {
    "2.0": {"modelDescription.xml": "fmi2/fmi2ModelDescription.xsd"},
    "3.0": {
        "modelDescription.xml": "fmi3/fmi3ModelDescription.xsd",
        "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
    },
}


def main(paths):
    schemas, failed = {}, False
    for path in paths:
        with zipfile.ZipFile(path) as archive:
            root = etree.parse(io.BytesIO(archive.read("modelDescription.xml"))).getroot()
            problems = []
            for name, file in FILES[root.get("fmiVersion")].items():
                if file not in schemas:
                    schemas[file] = etree.XMLSchema(etree.parse(SCHEMAS / file))
                schema = schemas[file]
                if not schema.validate(etree.parse(io.BytesIO(archive.read(name)))):
                    problems += [f"{name}: {error}" for error in schema.error_log]
        print(f"{'FAILED' if problems else 'ok'} {path} {' '.join(problems)}")
        failed = failed or bool(problems)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""SSP archives against the published schemas of their version.

Usage: ssp_schema.py VERSION FILE.ssp...
Also says what is wrong with a description that was spoiled on purpose, so that it cannot pass unread.
"""

import os
import sys
import zipfile

from lxml import etree

KINDS = {
    "SystemStructureDescription": "SystemStructureDescription.xsd",
    "ParameterSet": "SystemStructureParameterValues.xsd",
    "ParameterMapping": "SystemStructureParameterMapping.xsd",
}


def folder(version):
    if version == "1.0":
        import fmpy

        return os.path.join(os.path.dirname(fmpy.__file__), "ssp", "schema")
    import pyssp_standard

    return os.path.join(os.path.dirname(pyssp_standard.__file__), "resources", "ssp2")


def schema(kind, version, known={}):
    key = kind, version
    if key not in known:
        known[key] = etree.XMLSchema(etree.parse(os.path.join(folder(version), KINDS[kind])))
    return known[key]


def problems(root, version):
    """Of an element and of the sets and mappings that stand within it."""
    found = []
    for element in root.iter():
        if not isinstance(element.tag, str):
            continue
        name = etree.QName(element).localname
        if name in KINDS:
            valid = schema(name, version)
            # A document of its own, as the schema wants it.
            alone = etree.fromstring(etree.tostring(element))
            if not valid.validate(alone):
                found += [f"{name}: {error}" for error in valid.error_log]
    return found


def main():
    version, *paths = sys.argv[1:]
    failures = 0
    for path in paths:
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                if not name.endswith((".ssd", ".ssv", ".ssm")):
                    continue
                root = etree.fromstring(archive.read(name))
                found = problems(root, version)
                failures += bool(found)
                for problem in found:
                    print(f"FAILED {path}: {name}: {problem}")
                if not found:
                    print(f"ok {path}: {name}")
                if name.endswith(".ssd"):
                    next(root.iter("{*}Connector")).attrib.pop("kind")
                    assert problems(root, version), "a spoiled description passes"
    raise SystemExit(1 if failures else 0)


if __name__ == "__main__":
    main()

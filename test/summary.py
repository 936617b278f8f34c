#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
#
# summary.py FOLDER STATUS: sums up what ctest, which ended with STATUS, ran, from FOLDER/ctest.junit. An entry that left
# records of single cases (FOLDER/<entry>.xml or, of a rostest, all files of FOLDER/<entry>/) counts as these; any other
# counts as one, and so does one that failed though none of its cases did. Names what failed, with the figures, and what
# was skipped; the closing line stands alone: `N passed, N failed, N skipped`. The exit status is 0 where something
# passed and nothing failed.
import pathlib
import re
import sys
import xml.etree.ElementTree as xml

SLOW = 60.0  # [s] that no entry should take on idle cores


def records(folder, entry):
    for path in [folder / f"{entry}.xml", *sorted((folder / entry).rglob("*.xml"))]:
        if path.is_file():
            yield from xml.parse(path).iter("testcase")


def failure(text):
    """The lines that say which expectation failed, and its figures."""
    found = re.search(r"^.*: (Failure|error: .*)\n(?:(?!\[ ).*\n?){1,5}", text, re.MULTILINE)
    lines = found.group(0).splitlines() if found else text.splitlines()[-5:]
    return "".join(f"\n           {line}" for line in lines if line.strip())


def of_case(case, entry):
    room = entry.split(".shard_")[0] + "." if ".shard_" in entry else ""
    name = f"{room}{case.get('classname')}.{case.get('name')}"
    for found in [*case.iter("failure"), *case.iter("error")]:
        return "failed", name, failure(f"{name}: Failure\n{found.text or found.get('message') or ''}")
    skipped = case.find("skipped") is not None or case.get("status") == "notrun"
    return ("skipped" if skipped else "passed"), name, ""


def of_entry(entry):
    name, status = entry.get("name"), entry.get("status")
    if status == "run":
        return "passed", name, ""
    skipped = entry.find("skipped")
    why = skipped.get("message") or "" if skipped is not None else ""
    if status == "disabled" or "REGULAR_EXPRESSION" in why or "SKIP_RETURN_CODE" in why:
        return "skipped", name, ""
    return "failed", name, failure(entry.findtext("system-out") or "") if status == "fail" else f" ({why or status})"


def main(folder, status):
    outcomes = []
    for entry in xml.parse(folder / "ctest.junit").iter("testcase"):
        own = [of_case(case, entry.get("name")) for case in records(folder, entry.get("name"))]
        whole = of_entry(entry)
        if not own or (whole[0] == "failed" and all(outcome != "failed" for outcome, _, _ in own)):
            own.append(whole)
        outcomes += own
        if float(entry.get("time") or 0.0) > SLOW:
            print(f"slow     {entry.get('name')}: {float(entry.get('time')):.0f} s")
    if status != 0 and all(outcome != "failed" for outcome, _, _ in outcomes):
        outcomes.append(("failed", f"ctest itself, with status {status}", ""))
    count = {"passed": 0, "failed": 0, "skipped": 0}
    for outcome, name, detail in sorted(outcomes, key=lambda o: o[0] == "failed"):
        count[outcome] += 1
        if outcome != "passed":
            print(f"{'FAILED' if outcome == 'failed' else outcome:8} {name}{detail}")
    print(f"{count['passed']} passed, {count['failed']} failed, {count['skipped']} skipped")
    return 0 if count["passed"] and not count["failed"] else 1


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]), int(sys.argv[2])))

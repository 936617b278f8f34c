# SPDX-License-Identifier: Apache-2.0
"""The command-line program, which here reads every kind of log that `dynid.read` does."""

import sys


def main(arguments=None):
    """Runs `dynid ARGUMENTS...` and returns its exit status."""
    from . import _core
    from ._files import columns_for_program

    _core.set_log_reader(columns_for_program)
    return _core.main(["dynid", *(sys.argv[1:] if arguments is None else arguments)])


if __name__ == "__main__":
    sys.exit(main())

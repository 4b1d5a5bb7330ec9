"""`python -m fluentboard` is the command `fluentboard`."""

from fluentboard.cli import main

if __name__ == "__main__":
    main()

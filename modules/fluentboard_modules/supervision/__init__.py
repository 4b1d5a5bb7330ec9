"""`fluentboard up`: a board and its workers as one, restarted when they crash."""

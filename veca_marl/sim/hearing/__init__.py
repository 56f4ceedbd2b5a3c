"""Hearing: receivers, head-related transfer functions and the sense of hearing."""

"""Errors of redundax: those that it raises itself, so that a refusal can be told from a crash."""


class RedundaxError(ValueError):
    """A refusal in words: which argument does not fit, and what to change.

    Every error that redundax raises by itself is one; any other one (of NumPy, of JAX, of Python) is a crash.

        ```python
        try:
            rx.solve(mechanism, state, closure="soft")
        except rx.RedundaxError as error:
            print(error)
        ```
    """


class NoSolutionError(RedundaxError, RuntimeError):
    """Arguments are sound, but there is no answer for them: the message says why, and what to try.

    ```python
    try:
        rx.assemble(mechanism, jnp.full(len(mechanism.coordinates), 1e3))
    except rx.NoSolutionError as error:
        print(error)
    ```
    """

"""Stops one thread of a program that was started here, as if its current call never ended (Linux, ptrace)."""

import contextlib
import ctypes
import os

PTRACE_SEIZE, PTRACE_INTERRUPT, PTRACE_DETACH = 0x4206, 0x4207, 17
# also of threads
ANY_KIND = 0x40000000


def thread_of(process, name):
    """The id of the thread with this name; None while there is none."""
    for thread in os.listdir(f"/proc/{process}/task"):
        with contextlib.suppress(FileNotFoundError), open(f"/proc/{process}/task/{thread}/comm") as comm:
            if comm.read().strip() == name:
                return int(thread)
    return None


class HeldThread:
    """Stopped until it is released, or dies with its program. Only one thread may use this, as ptrace requires."""

    def __init__(self, thread):
        self.libc = ctypes.CDLL(None, use_errno=True)
        self.thread = thread
        self._ask(PTRACE_SEIZE)
        self._ask(PTRACE_INTERRUPT)
        os.waitpid(thread, ANY_KIND)

    def _ask(self, request):
        nothing = ctypes.c_void_p(0)
        if self.libc.ptrace(request, self.thread, nothing, nothing) != 0:
            code = ctypes.get_errno()
            raise OSError(code, os.strerror(code))

    def has_died(self):
        """Whether it has died. The kernel keeps it until somebody asks."""
        if self.thread:
            pid, status = os.waitpid(self.thread, os.WNOHANG | ANY_KIND)
            if pid and not os.WIFSTOPPED(status):
                self.thread = None
        return self.thread is None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if not self.has_died():
            with contextlib.suppress(OSError):
                self._ask(PTRACE_DETACH)

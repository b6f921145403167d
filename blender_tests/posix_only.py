"""Find calls that Windows lacks and text files opened without an encoding in a package's sources."""

import ast
from collections.abc import Iterator
from pathlib import Path

MODULES = {"crypt", "fcntl", "grp", "nis", "pty", "pwd", "resource", "syslog", "termios", "tty"}  # that Windows lacks
CALLS = {  # names of other modules that it lacks
    "os": set(
        "chown chroot fchmod fchown fork forkpty getegid geteuid getgid getgroups getloadavg getpgid getpgrp "
        "getpriority getresuid getsid getuid initgroups killpg lchown mkfifo mknod nice openpty pathconf posix_fallocate "
        "posix_spawn pread preadv pwrite readv register_at_fork sched_getaffinity sched_setaffinity sched_yield "
        "sendfile setegid seteuid setgid setpgid setpriority setsid setuid statvfs sync sysconf tcsetpgrp uname wait "
        "wait3 wait4 waitid WEXITSTATUS WIFEXITED WIFSIGNALED WTERMSIG writev".split()
    ),
    "signal": set(
        "SIGKILL SIGHUP SIGQUIT SIGUSR1 SIGUSR2 SIGALRM SIGCHLD SIGCONT SIGSTOP SIGTSTP SIGPIPE alarm pause "
        "pthread_kill pthread_sigmask setitimer sigwait".split()
    ),
    "time": {"tzset", "pthread_getcpuclockid"},
}
GUARDS = ("os.name", "sys.platform", "hasattr")


def unguarded(package: Path, without: tuple[str, ...] = ()) -> Iterator[str]:
    """A line for each unguarded use of something that Windows lacks.

    A guard is an `if` that checks `os.name`, `sys.platform` or `hasattr`, around the use or before it with a return,
    or a `try` that expects an ImportError. `without`: folders to skip.
    """
    for path in sorted(package.rglob("*.py")):
        if path.relative_to(package).parts[0] in without:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node, around in _with_surroundings(tree, ()):
            name = _posix_name(node)
            if name and not any(_is_guard(place, node.lineno) for place in around):
                yield f"{path.name}:{node.lineno}: {name}"


def without_encoding(package: Path) -> Iterator[str]:
    """A line for each text file that is opened, read or written without naming an encoding."""
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and _opens_text(node):
                if not any(keyword.arg == "encoding" for keyword in node.keywords):
                    yield f"{path.name}:{node.lineno}"


def _with_surroundings(node: ast.AST, around: tuple) -> Iterator[tuple[ast.AST, tuple]]:
    for child in ast.iter_child_nodes(node):
        yield child, (*around, node)
        yield from _with_surroundings(child, (*around, node))


def _posix_name(node: ast.AST) -> str:
    """The name that a node uses and Windows lacks, or an empty text."""
    names = []  # (module, name in it)
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        names = [(node.value.id, node.attr)]
    elif isinstance(node, ast.Import):
        names = [(alias.name, "") for alias in node.names]
    elif isinstance(node, ast.ImportFrom) and node.level == 0:
        names = [(node.module, alias.name) for alias in node.names]
    is_import = isinstance(node, ast.Import | ast.ImportFrom)
    lacking = [pair for pair in names if pair[1] in CALLS.get(pair[0], ()) or (is_import and pair[0] in MODULES)]
    return ".".join(lacking[0]) if lacking else ""


def _is_guard(node: ast.AST, line: int) -> bool:
    """Test whether a surrounding node guards this line of it."""
    if isinstance(node, ast.If | ast.IfExp):
        return any(word in ast.unparse(node.test) for word in GUARDS)
    if isinstance(node, ast.FunctionDef):
        leaving = [part for part in node.body if isinstance(part, ast.If) and isinstance(part.body[-1], ast.Return)]
        return any(part.lineno < line and _is_guard(part, line) for part in leaving)
    if isinstance(node, ast.Try):
        return any(handler.type and "ImportError" in ast.unparse(handler.type) for handler in node.handlers)
    return False


def _opens_text(call: ast.Call) -> bool:
    """Test whether a call opens a file as text: `open`, and `.open`, `.read_text` and `.write_text` of paths."""
    name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
    if name in ("read_text", "write_text"):
        return isinstance(call.func, ast.Attribute)
    values = [*call.args[:2], *(keyword.value for keyword in call.keywords)]
    texts = [value.value for value in values if isinstance(value, ast.Constant) and isinstance(value.value, str)]
    is_file = name == "open" and (isinstance(call.func, ast.Name) or not call.args or texts)
    return is_file and not any("b" in text for text in texts)

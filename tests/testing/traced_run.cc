#include "tests/testing/traced_run.h"

#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace sateen::testing {
namespace {

// Lets every system call through and tells the tracer of those that change files.
std::vector<sock_filter> Filter() {
  std::vector<sock_filter> filter;
  const auto load = [&](size_t offset) {
    filter.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<uint32_t>(offset)));
  };
  const auto trace = [&] { filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRACE)); };
  const auto allow = [&] { filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)); };
  const auto argument = [](size_t n) { return offsetof(seccomp_data, args) + 8 * n; };
  load(offsetof(seccomp_data, nr));
  for (const int call : {
           SYS_fsync,     SYS_fdatasync, SYS_renameat, SYS_renameat2,
           SYS_linkat,    SYS_symlinkat, SYS_unlinkat, SYS_mkdirat,
           SYS_ftruncate, SYS_fallocate, SYS_flock,    SYS_copy_file_range,
           SYS_pwrite64,  SYS_fchmodat,
#ifdef SYS_rename
           SYS_rename,    SYS_link,      SYS_symlink,  SYS_unlink,
           SYS_mkdir,     SYS_rmdir,     SYS_chmod,    SYS_creat,
#endif
       }) {
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<uint32_t>(call), 0, 1));
    trace();
  }
  // Opening counts where it may create a file; writing where it is not to a standard stream.
  const auto trace_where_created = [&](int call, size_t flags) {
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<uint32_t>(call), 0, 4));
    load(argument(flags));
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, O_CREAT, 0, 1));
    trace();
    allow();
  };
  trace_where_created(SYS_openat, 2);
#ifdef SYS_open
  trace_where_created(SYS_open, 1);
#endif
  for (const int call : {SYS_write, SYS_writev}) {
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<uint32_t>(call), 0, 4));
    load(argument(0));
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JGT | BPF_K, 2, 0, 1));
    trace();
    allow();
  }
  allow();
  return filter;
}

[[noreturn]] void RunTracee(const std::function<int()>& body) {
  std::vector<sock_filter> filter = Filter();
  const sock_fprog program = {.len = static_cast<unsigned short>(filter.size()),
                              .filter = filter.data()};
  if (ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0 || std::raise(SIGSTOP) != 0 ||
      prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
      prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) != 0) {
    std::perror("cannot be traced");
    _exit(127);
  }
  _exit(body());
}

// What a stopped thread is to be told when it goes on.
long SignalFor(int status) {
  const int signal = WSTOPSIG(status);
  const bool is_event = status >> 16 != 0;
  return is_event || signal == SIGTRAP || signal == SIGSTOP ? 0 : signal;
}

}  // namespace

TracedRun RunTraced(const std::function<int()>& body, int kill_at) {
  TracedRun run;
  const pid_t child = fork();
  if (child == 0) {
    RunTracee(body);
  }
  int status = 0;
  waitpid(child, &status, 0);
  constexpr long kOptions = PTRACE_O_TRACESECCOMP | PTRACE_O_TRACECLONE | PTRACE_O_TRACEFORK |
                            PTRACE_O_TRACEVFORK | PTRACE_O_TRACEEXEC | PTRACE_O_EXITKILL;
  ptrace(PTRACE_SETOPTIONS, child, nullptr, kOptions);
  ptrace(PTRACE_CONT, child, nullptr, 0L);
  while (true) {
    const pid_t thread = waitpid(-1, &status, __WALL);
    if (thread < 0) {
      return run;
    }
    if (thread == child && !WIFSTOPPED(status)) {
      run.is_killed = WIFSIGNALED(status);
      run.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
      continue;  // until its children are gone, too
    }
    if (!WIFSTOPPED(status)) {
      continue;
    }
    if (status >> 8 == (SIGTRAP | (PTRACE_EVENT_SECCOMP << 8)) && run.calls++ == kill_at) {
      kill(child, SIGKILL);
      continue;
    }
    ptrace(PTRACE_CONT, thread, nullptr, SignalFor(status));
  }
}

}  // namespace sateen::testing

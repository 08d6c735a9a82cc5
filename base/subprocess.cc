#include "base/subprocess.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "base/error.h"
#include "base/progress.h"

namespace unfurl {

namespace {
constexpr int kNotStarted = 127;  // the shell's exit status for a program that was not found
}

ProgramOutcome RunProgram(const std::vector<std::string>& words, const std::string& folder,
                          const std::string& out, const std::string& err, double timeout) {
  using Clock = std::chrono::steady_clock;
  // Everything that allocates comes before the fork: other threads may hold the heap's lock.
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  int failed[2];
  if (pipe2(failed, O_CLOEXEC) != 0) return {};
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // should this program be killed, so is what it started
    const int in_file = open("/dev/null", O_RDONLY);
    const int out_file = open(out.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
    const int err_file = open(err.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
    dup2(in_file, STDIN_FILENO);
    dup2(out_file, STDOUT_FILENO);
    dup2(err_file, STDERR_FILENO);
    if (chdir(folder.c_str()) == 0) execvp(argv[0], argv.data());
    const char mark = 1;
    if (write(failed[1], &mark, 1) != 1) _exit(kNotStarted);
    _exit(kNotStarted);
  }
  close(failed[1]);
  ProgramOutcome outcome;
  if (child < 0) {
    close(failed[0]);
    return outcome;
  }
  setpgid(child, child);
  // The pipe closes when the program is on its way, or says that there is none.
  char mark = 0;
  outcome.started = read(failed[0], &mark, 1) <= 0;
  close(failed[0]);
  const Clock::time_point start = Clock::now();
  auto pause = std::chrono::microseconds(200);
  int status = 0;
  bool interrupted = false;
  while (waitpid(child, &status, WNOHANG) == 0) {
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    interrupted = InterruptRequested();
    if (interrupted || seconds > timeout) {
      outcome.timed_out = !interrupted;
      kill(-child, SIGKILL);
      waitpid(child, &status, 0);
      break;
    }
    std::this_thread::sleep_for(pause);
    pause = std::min<std::chrono::microseconds>(2 * pause, std::chrono::milliseconds(20));
  }
  kill(-child, SIGKILL);  // what it left running
  if (interrupted) throw Interrupted();
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

}  // namespace unfurl

#include "campaign/evaluation_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/inputs.h"
#include "data/journal.h"

namespace unfurl::campaign {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr char kAbout[] = "fit.json", kBeat[] = "beat", kQuestions[] = "questions",
               kTaken[] = "taken", kAnswers[] = "answers", kScript[] = "task.sh", kLog[] = "log-",
               kClock[] = "clock-";
constexpr char kFolderSchema[] = "unfurl/evaluations";
std::string Name(std::uint64_t question) { return fmt::format("{:08}", question); }

// Names in order: the oldest question first.
std::vector<std::string> NamesIn(const fs::path& folder) {
  std::vector<std::string> out;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    out.push_back(it->path().filename().string());
  }
  std::sort(out.begin(), out.end());
  return out;
}

// Sets a file's time to now by the clock of whoever keeps it; `made`: makes it where it is not.
void Touch(const fs::path& path, bool made) {
  const int flags = O_WRONLY | O_CLOEXEC | O_NOFOLLOW | (made ? O_CREAT : 0);
  const int file = open(path.c_str(), flags, 0666);
  if (file < 0) return;  // gone, or gone with its folder
  futimens(file, nullptr);
  close(file);
}

// A file of this thread's own.
std::string ClockName() { return fmt::format("{}{}-{}", kClock, ProcessName(), gettid()); }

// Null: there is no such file. Throws Error where another process holds it.
std::shared_ptr<const int> Locked(const fs::path& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return nullptr;
  std::shared_ptr<const int> lock(new int(file), [](const int* descriptor) {
    close(*descriptor);
    delete descriptor;
  });
  if (flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    throw Error("is in use by another fit", path.parent_path().string(),
                "wait for it, or give another --folder");
  }
  return lock;
}

// With a checksum in front.
void Put(const fs::path& path, const std::string& bytes) {
  const std::uint64_t sum = data::Checksum(bytes);
  std::string text(reinterpret_cast<const char*>(&sum), sizeof sum);
  data::WriteTextFile(path.string(), text + bytes);
}

std::string Get(const fs::path& path) {
  const std::string text = data::ReadTextFile(path.string());
  data::ForgetInput(path.string());
  std::uint64_t sum = 0;
  if (text.size() >= sizeof sum) text.copy(reinterpret_cast<char*>(&sum), sizeof sum);
  std::string bytes = text.size() < sizeof sum ? std::string() : text.substr(sizeof sum);
  if (text.size() < sizeof sum || data::Checksum(bytes) != sum) {
    throw Error("is damaged", path.string(), "look at the disk, and start again with --resume",
                ErrorKind::kMachine);
  }
  return bytes;
}

// The identity that fit.json of such a folder tells.
std::string ReadAbout(const std::string& about) {
  std::error_code ignored;
  if (!fs::exists(about, ignored)) {
    throw Error("holds no questions of a fit", fs::path(about).parent_path().string(),
                "start the fit with --engine first, in a folder that is not there yet");
  }
  const std::string text = data::ReadTextFile(about);
  data::ForgetInput(about);  // ours to replace
  try {
    const ordered_json j = ordered_json::parse(text);
    if (j.at("schema") != kFolderSchema || j.at("version") != 1) {
      throw Error("is of another version of this program", about, "use one version for both");
    }
    return j.at("identity");
  } catch (const nlohmann::json::exception&) {
    throw Error("does not say what the questions are about", about, "give another folder");
  }
}

bool IsOurs(const std::string& name) {
  return name == kAbout || name == kBeat || name == kQuestions || name == kTaken ||
         name == kAnswers || name == kScript || name.rfind(kClock, 0) == 0 ||
         name.rfind(kLog, 0) == 0;
}

// Throws Error for what is not a folder of questions, or an empty one. What says that it is one is
// written first, so that a folder that was left at any moment is known.
void CheckOurs(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) {
    throw Error("is there, and is no folder", path, "give one that is not there yet");
  }
  const std::vector<std::string> names = NamesIn(path);
  if (names.empty()) return;
  for (const std::string& name : names) {
    if (IsOurs(name)) continue;
    throw Error("holds '" + name + "', which is none of a fit's questions", path,
                "give a folder that is not there yet");
  }
  ReadAbout((fs::path(path) / kAbout).string());
}

}  // namespace

std::string ProcessName() {
  char host[256] = "";
  gethostname(host, sizeof host - 1);
  std::string name = fmt::format("{}-{}", host, getpid());
  std::replace(name.begin(), name.end(), '.', '-');
  return name;
}

fs::path EvaluationFolder::In(const char* part, const std::string& name) const {
  return fs::path(path_) / part / name;
}

EvaluationFolder EvaluationFolder::Make(const std::string& path, const std::string& identity) {
  EvaluationFolder folder(path);
  std::error_code error;
  if (fs::exists(fs::symlink_status(path, error))) {
    CheckOurs(path);
    // Of one that was killed the lock is gone.
    const auto lock = Locked(fs::path(path) / kBeat);
    folder.Clear(false);
  }
  fs::create_directories(path, error);
  if (!error) {
    const ordered_json about = {{"schema", kFolderSchema}, {"version", 1}, {"identity", identity}};
    data::WriteTextFile((fs::path(path) / kAbout).string(), about.dump(1) + "\n");
    for (const char* part : {kQuestions, kTaken, kAnswers}) {
      if (!error) fs::create_directory(fs::path(path) / part, error);
    }
  }
  if (error) {
    throw Error("cannot be made: " + error.message(), path, "give another --folder",
                ErrorKind::kMachine);
  }
  folder.Beat();
  folder.lock_ = Locked(fs::path(path) / kBeat);
  return folder;
}

EvaluationFolder EvaluationFolder::Open(const std::string& path, const std::string& identity) {
  if (ReadAbout((fs::path(path) / kAbout).string()) != identity) {
    throw Error("is of a fit of another study, scene, trial or version of this program", path,
                "give the study, --set and --tracks as the fit has them");
  }
  return EvaluationFolder(path);
}

void EvaluationFolder::Ask(std::uint64_t question, const std::string& bytes) const {
  Put(In(kQuestions, Name(question)), bytes);
}

bool EvaluationFolder::Fetch(std::uint64_t question, std::string* bytes) const {
  const fs::path path = In(kAnswers, Name(question));
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return false;
  *bytes = Get(path);
  fs::remove(path, ignored);
  return true;
}

void EvaluationFolder::Beat() const { Touch(fs::path(path_) / kBeat, true); }

std::vector<std::uint64_t> EvaluationFolder::AskAgain(double silence) const {
  std::vector<std::uint64_t> out;
  for (const std::string& name : NamesIn(fs::path(path_) / kTaken)) {
    std::uint64_t question = 0;
    const std::string number = name.substr(0, name.find('.'));
    if (!ParseWhole(number, &question) || Age(In(kTaken, name)) < silence) continue;
    std::error_code error;
    // A worker that was merely slow may still answer: to the same bits.
    fs::rename(In(kTaken, name), In(kQuestions, number), error);
    if (!error) out.push_back(question);
  }
  return out;
}

void EvaluationFolder::Clear(bool keep_logs) const {
  std::error_code ignored;
  // What says that the folder is ours goes last.
  for (const std::string& name : NamesIn(path_)) {
    const bool kept = name == kAbout || (keep_logs && name.rfind(kLog, 0) == 0);
    if (IsOurs(name) && !kept) fs::remove_all(fs::path(path_) / name, ignored);
  }
  if (!keep_logs || NamesIn(path_).size() == 1) {
    fs::remove(fs::path(path_) / kAbout, ignored);
  }
}

void EvaluationFolder::Close(bool keep_logs) const {
  // A worker that looks at its clock meanwhile puts a file back; once it finds none of the rest it
  // ends.
  constexpr int kTries = 1000;
  for (int k = 0; k < kTries; ++k) {
    Clear(keep_logs);
    std::error_code failed;
    if (fs::remove(path_, failed)) return;
    const std::vector<std::string> left = NamesIn(path_);
    const auto comes_back = [](const std::string& name) {
      return name == kBeat || name.rfind(kClock, 0) == 0;
    };
    // Logs, or files of others; where nothing is left, it came and went since.
    if (!left.empty() && std::none_of(left.begin(), left.end(), comes_back)) return;
  }
}

std::string EvaluationFolder::LogPath(const std::string& name) const {
  return (fs::path(path_) / (kLog + name)).string();
}

bool EvaluationFolder::Take(const std::string& worker, std::uint64_t* question,
                            std::string* bytes) const {
  for (const std::string& name : NamesIn(fs::path(path_) / kQuestions)) {
    if (!ParseWhole(name, question)) continue;  // on its way
    const fs::path mine = In(kTaken, fmt::format("{}.{}", name, worker));
    std::error_code error;
    Touch(In(kQuestions, name), false);  // so that it looks fresh from the moment that it is ours
    fs::rename(In(kQuestions, name), mine, error);
    if (error) continue;  // somebody was quicker
    *bytes = Get(mine);
    return true;
  }
  return false;
}

void EvaluationFolder::Working(const std::string& worker, std::uint64_t question) const {
  // Not made anew where the fit has taken it back.
  Touch(In(kTaken, Name(question) + "." + worker), false);
}

void EvaluationFolder::Answer(const std::string& worker, std::uint64_t question,
                              const std::string& bytes) const {
  std::error_code ignored;
  if (!fs::exists(In(kAnswers, ""), ignored)) return;  // the fit has ended
  Put(In(kAnswers, Name(question)), bytes);
  fs::remove(In(kTaken, Name(question) + "." + worker), ignored);
}

bool EvaluationFolder::IsLeft(double silence) const {
  return Age(fs::path(path_) / kBeat) > silence;
}

double EvaluationFolder::Age(const fs::path& file) const {
  struct stat then = {}, now = {};
  if (stat(file.c_str(), &then) != 0) return std::numeric_limits<double>::infinity();
  // Clocks of machines differ; that of the folder is one.
  const fs::path clock = fs::path(path_) / ClockName();
  Touch(clock, true);
  const bool read = stat(clock.c_str(), &now) == 0;
  unlink(clock.c_str());
  if (!read) return std::numeric_limits<double>::infinity();
  return static_cast<double>(now.st_mtim.tv_sec - then.st_mtim.tv_sec) +
         1e-9 * static_cast<double>(now.st_mtim.tv_nsec - then.st_mtim.tv_nsec);
}

}  // namespace unfurl::campaign

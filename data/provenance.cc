#include "data/provenance.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <nettle/sha2.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "base/error.h"
#include "data/inputs.h"

namespace unfurl::data {

namespace {

class Sha256 {
 public:
  Sha256() { sha256_init(&state_); }
  void Add(const void* bytes, std::size_t size) {
    sha256_update(&state_, size, static_cast<const std::uint8_t*>(bytes));
  }
  std::string Hex() {
    std::array<std::uint8_t, SHA256_DIGEST_SIZE> digest{};
    sha256_digest(&state_, digest.size(), digest.data());
    return fmt::format("{:02x}", fmt::join(digest, ""));
  }

 private:
  sha256_ctx state_ = {};
};

struct Closes {
  int file;
  ~Closes() { close(file); }
};

}  // namespace

std::string FileSha256(const std::string& path) {
  const Closes opened{open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  Sha256 sha;
  std::vector<char> piece(std::size_t{1} << 17);  // [byte]: what one read takes
  for (;;) {
    const ssize_t size = opened.file < 0 ? -1 : read(opened.file, piece.data(), piece.size());
    if (size == 0) return sha.Hex();
    if (size < 0 && (opened.file < 0 || errno != EINTR)) {
      throw Error(std::string("cannot read: ") + std::strerror(errno), path, "check the name");
    }
    if (size > 0) sha.Add(piece.data(), static_cast<std::size_t>(size));
  }
}

std::string TextSha256(const std::string& text) {
  Sha256 sha;
  sha.Add(text.data(), text.size());
  return sha.Hex();
}

namespace {

// A file's state, to tell whether it changed between two looks.
struct State {
  dev_t device = 0;
  ino_t inode = 0;
  off_t size = 0;
  timespec changed = {};
  bool operator==(const State& other) const {
    return device == other.device && inode == other.inode && size == other.size &&
           changed.tv_sec == other.changed.tv_sec && changed.tv_nsec == other.changed.tv_nsec;
  }
};

bool StateOf(const std::string& path, State* state) {
  struct stat info = {};
  if (stat(path.c_str(), &info) != 0) return false;
  *state = {info.st_dev, info.st_ino, info.st_size, info.st_mtim};
  return true;
}

struct Noted {
  std::string sha256;  // empty: opened only
  bool pipe = false;
  std::string text;  // of a pipe
  State state;
};

std::mutex g_mutex;
std::map<std::string, Noted>& Inputs() {
  static auto* inputs = new std::map<std::string, Noted>;
  return *inputs;
}

constexpr std::size_t kMost = 10000;  // what a program writes per evaluation would grow the lists

void Note(const std::string& path, Noted noted) {
  const std::lock_guard<std::mutex> lock(g_mutex);
  if (Inputs().size() < kMost || Inputs().contains(path)) Inputs()[path] = std::move(noted);
}

std::atomic<bool> g_protects{false};
std::set<std::string>& Protected() {  // device and inode
  static auto* identities = new std::set<std::string>;
  return *identities;
}

// Empty for what is no file.
std::string IdentityOf(const std::string& path) {
  struct stat info = {};
  if (stat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return {};
  return std::to_string(info.st_dev) + ":" + std::to_string(info.st_ino);
}

}  // namespace

void NoteText(const std::string& path, const std::string& text, bool regular) {
  Noted noted{TextSha256(text), !regular, regular ? std::string() : text, {}};
  Note(path, std::move(noted));
  if (g_protects) ProtectInput(path);
}

void ForgetInput(const std::string& path) {
  const std::string identity = IdentityOf(path);
  const std::lock_guard<std::mutex> lock(g_mutex);
  Inputs().erase(path);
  Protected().erase(identity);
}

void ProtectInput(const std::string& path) {
  const std::string identity = IdentityOf(path);
  if (identity.empty()) return;
  const std::lock_guard<std::mutex> lock(g_mutex);
  if (Protected().size() < kMost) Protected().insert(identity);
}

void ProtectWhatIsRead() { g_protects = true; }

bool IsInput(const std::string& path) {
  const std::string identity = IdentityOf(path);
  if (identity.empty()) return false;
  const std::lock_guard<std::mutex> lock(g_mutex);
  return Protected().contains(identity);
}

bool RecallPipe(const std::string& path, std::string* text) {
  const std::lock_guard<std::mutex> lock(g_mutex);
  const auto found = Inputs().find(path);
  if (found == Inputs().end() || !found->second.pipe) return false;
  *text = found->second.text;
  return true;
}

void NoteOpened(const std::string& path) {
  Noted noted;
  if (!StateOf(path, &noted.state)) return;
  Note(path, std::move(noted));
  if (g_protects) ProtectInput(path);
}

void Provenance::AddInput(const std::string& path) {
  Noted noted;
  bool known = false;
  {
    const std::lock_guard<std::mutex> lock(g_mutex);
    const auto found = Inputs().find(path);
    known = found != Inputs().end();
    if (known) noted = found->second;
  }
  if (known && !noted.sha256.empty()) {
    inputs.push_back({path, noted.sha256});
    return;
  }
  const std::string sha256 = FileSha256(path);
  State now;
  if (known && (!StateOf(path, &now) || !(now == noted.state))) {
    throw Error("changed while it was read", path, "wait until it is whole, and start again");
  }
  inputs.push_back({path, sha256});
}

std::string ProgramVersion() { return "unfurl " UNFURL_VERSION; }

}  // namespace unfurl::data

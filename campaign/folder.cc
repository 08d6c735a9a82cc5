#include "campaign/folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "base/folder.h"
#include "data/atomic_file.h"
#include "data/inputs.h"
#include "data/provenance.h"

namespace unfurl::campaign {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr char kPlan[] = "campaign.json", kParts[] = "parts", kLogs[] = "logs", kLock[] = "lock",
               kHiddenPlan[] = ".campaign.json.";  // of a plan being written (AtomicFile)

// What a program that was killed early leaves: our own names, and no plan yet.
bool IsUnfinished(const std::string& path) {
  std::error_code failed;
  if (!fs::is_directory(path, failed)) return false;
  for (const std::string& name : NamesIn(path)) {
    if (name != kParts && name != kLogs && name != kLock && !name.starts_with(kHiddenPlan)) {
      return false;
    }
  }
  return true;
}

// What a folder says of itself is no input: it is replaced when runs are added.
std::string ReadState(const std::string& path) {
  std::string text = data::ReadTextFile(path);
  data::ForgetInput(path);
  return text;
}

// "0000000100-0000000200.h5"; false for another name.
bool RangeOf(const std::string& name, RunRange* range) {
  if (!name.ends_with(".h5")) return false;
  std::string text = name.substr(0, name.size() - 3);
  std::replace(text.begin(), text.end(), '-', ':');
  return ParseRange(text, range);
}

void MakeFolder(const fs::path& path) {
  std::error_code failed;
  fs::create_directories(path, failed);
  if (failed) {
    throw Error("cannot be made: " + failed.message(), path.string(),
                "name a folder elsewhere with --folder, and an output with -o",
                ErrorKind::kMachine);
  }
}

}  // namespace

std::string IdentityOf(const data::Campaign& plan, const std::vector<std::string>& inputs) {
  data::Campaign bare = plan;
  bare.name = bare.path = bare.job.scene = bare.job.where = "";
  bare.confidence = 0.0;
  bare.slurm.clear();
  bare.inputs.clear();
  bare.job.files.clear();
  for (data::CampaignVariable& v : bare.variables) v.where.clear();
  for (data::CampaignResponse& r : bare.responses) r.where.clear();
  bare.design.until.clear();
  bare.design.most = 0;
  if (Extendable(bare.design.kind)) bare.design.runs = 0;
  std::string text = data::ProgramVersion() + "\n" + data::CampaignJson(bare) + "\n";
  for (const std::string& file : inputs) text += data::FileSha256(file) + "\n";
  return data::TextSha256(text);
}

CampaignFolder CampaignFolder::Make(const std::string& path, const data::Campaign& plan,
                                    const std::string& identity) {
  if (fs::exists(fs::path(path) / kPlan)) {
    CampaignFolder there = Open(path);
    if (there.identity() != identity) {
      throw Error("holds runs of another plan, scene or version of this program", path,
                  "name another folder with --folder, or remove it");
    }
    there.WritePlan(plan);
    return there;
  }
  std::error_code ignored;
  if (fs::exists(path, ignored) && !IsUnfinished(path)) {
    throw Error("is there, and is no campaign's folder", path, "name another with --folder");
  }
  MakeFolder(fs::path(path) / kParts);
  MakeFolder(fs::path(path) / kLogs);
  CampaignFolder made(path, identity);
  made.WritePlan(plan);
  return made;
}

CampaignFolder CampaignFolder::Open(const std::string& path) {
  const std::string file = (fs::path(path) / kPlan).string();
  if (!fs::exists(file)) {
    throw Error("is no campaign's folder", path, "`unfurl campaign PLAN.toml` makes one");
  }
  const ordered_json j = ordered_json::parse(ReadState(file), nullptr, false);
  if (j.is_discarded() || !j.contains("identity") || !j["identity"].is_string()) {
    throw Error("holds no plan of this program", file, "remove the folder");
  }
  return {path, j["identity"].get<std::string>()};
}

data::Campaign CampaignFolder::ReadPlan() const {
  const std::string file = (fs::path(path_) / kPlan).string();
  const ordered_json j = ordered_json::parse(ReadState(file), nullptr, false);
  if (j.is_discarded() || !j.contains("plan")) {
    throw Error("holds no plan of this program", file, "remove the folder");
  }
  return data::CampaignFromJson(j["plan"].dump(), file);
}

void CampaignFolder::WritePlan(const data::Campaign& plan) const {
  const ordered_json j = {{"program", data::ProgramVersion()},
                          {"identity", identity_},
                          {"plan", ordered_json::parse(data::CampaignJson(plan))}};
  data::WriteTextFile((fs::path(path_) / kPlan).string(), j.dump(1) + "\n");
}

std::string CampaignFolder::PartPath(const RunRange& range) const {
  return (fs::path(path_) / kParts / fmt::format("{:010d}-{:010d}.h5", range.first, range.end()))
      .string();
}

std::string CampaignFolder::LogPath(const std::string& name) const {
  return (fs::path(path_) / kLogs / name).string();
}

std::vector<PartFile> CampaignFolder::Parts() const {
  const fs::path folder = fs::path(path_) / kParts;
  std::vector<PartFile> out;
  for (const std::string& name : NamesIn(folder.string())) {
    RunRange range;
    if (RangeOf(name, &range)) out.push_back({range, (folder / name).string()});
  }
  std::sort(out.begin(), out.end(), [](const PartFile& a, const PartFile& b) {
    return a.range.first != b.range.first ? a.range.first < b.range.first
                                          : a.range.count > b.range.count;
  });
  return out;
}

std::vector<RunRange> CampaignFolder::Missing(std::uint64_t runs) const {
  std::vector<RunRange> out;
  std::uint64_t next = 0;
  for (const PartFile& part : Parts()) {
    const std::uint64_t first = std::min(part.range.first, runs);
    if (first > next) out.push_back({next, first - next});
    next = std::max(next, std::min(part.range.end(), runs));
  }
  if (next < runs) out.push_back({next, runs - next});
  return out;
}

std::uint64_t CampaignFolder::MissingRuns(std::uint64_t runs) const {
  std::uint64_t count = 0;
  for (const RunRange& range : Missing(runs)) count += range.count;
  return count;
}

void CampaignFolder::Remove() const {
  std::error_code ignored;
  // With what killed programs left unfinished there.
  fs::remove_all(fs::path(path_) / kLogs, ignored);
  fs::remove_all(fs::path(path_) / kParts, ignored);
  fs::remove(fs::path(path_) / kPlan, ignored);
  fs::remove(fs::path(path_) / kLock, ignored);
  for (const std::string& name : NamesIn(path_)) {
    if (name.starts_with(kHiddenPlan)) fs::remove(fs::path(path_) / name, ignored);
  }
  fs::remove(path_, ignored);
}

CampaignFolder::Lock::Lock(const CampaignFolder& folder) {
  const std::string path = (fs::path(folder.path()) / kLock).string();
  file_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (file_ < 0) data::ThrowWriteError(path, errno);
  if (flock(file_, LOCK_EX | LOCK_NB) != 0) {
    close(file_);
    throw Error("another program is writing it", folder.path(),
                "wait for it, or name another folder with --folder");
  }
}

CampaignFolder::Lock::~Lock() { close(file_); }

std::string DefaultFolder(const std::string& plan) {
  return fs::path(plan).stem().string() + ".runs";
}

}  // namespace unfurl::campaign

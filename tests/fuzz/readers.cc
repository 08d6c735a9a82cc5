#include "tests/fuzz/readers.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "base/error.h"
#include "campaign/answers.h"
#include "data/atomic_file.h"
#include "data/campaign.h"
#include "data/channels.h"
#include "data/csv.h"
#include "data/design.h"
#include "data/fit.h"
#include "data/lab.h"
#include "data/modes.h"
#include "data/raw_layout.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/scene.h"
#include "data/study.h"
#include "data/survey.h"
#include "data/survey_points.h"
#include "data/toml.h"
#include "data/tracks.h"
#include "data/tracks_exchange.h"
#include "data/trial_readings.h"
#include "data/wand.h"
#include "tests/fuzz/inner_readers.h"

namespace unfurl::fuzz {

namespace {

// A file in memory: without a name, which is as good as a pipe; or, as HDF5 wants its real path, in
// a folder of the memory's.
class MemoryFile {
 public:
  MemoryFile(const std::string& bytes, bool named) {
    if (named) {
      path_ = fmt::format("/dev/shm/unfurl-fuzz-{}", getpid());
      file_ = open(path_.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
      named_ = true;
    } else {
      file_ = memfd_create("input", MFD_CLOEXEC);
      path_ = fmt::format("/proc/self/fd/{}", file_);
    }
    const auto size = static_cast<ssize_t>(bytes.size());
    if (file_ < 0 || write(file_, bytes.data(), bytes.size()) != size) std::abort();
  }
  ~MemoryFile() {
    close(file_);
    if (named_) unlink(path_.c_str());
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  int file_ = -1;
  bool named_ = false;
  std::string path_;
};

}  // namespace

const std::vector<Reader>& Readers() {
  static const std::vector<Reader> kReaders = {
      {"toml", [](const std::string& path) { data::LoadToml(path).Outline(); }},
      {"scene", [](const std::string& path) { data::ReadScene(path); }},
      {"lab", [](const std::string& path) { data::ReadLab(path); }},
      {"study", [](const std::string& path) { data::ReadStudy(path); }},
      {"raw_layout", [](const std::string& path) { data::ReadRawLayout(path); }},
      {"csv", [](const std::string& path) { data::CsvTable::Load(path); }},
      {"survey", [](const std::string& path) { data::ReadSurvey(path); }},
      {"points_csv", [](const std::string& path) { data::ReadPointsCsv(path); }},
      {"readings_csv", [](const std::string& path) { data::ReadReadingsCsv(path); }},
      {"channels_csv",
       [](const std::string& path) { data::ReadChannels(path, data::FileFormat::kCsv); }},
      {"channels_uff",
       [](const std::string& path) { data::ReadChannels(path, data::FileFormat::kUff); }},
      {"channels_h5",
       [](const std::string& path) { data::ReadChannels(path, data::FileFormat::kHdf5); }},
      {"campaign", [](const std::string& path) { data::ReadCampaign(path); }},
      {"campaign_json",
       [](const std::string& path) { data::CampaignFromJson(data::ReadTextFile(path), path); }},
      {"design", [](const std::string& path) { data::ReadDesign(path); }},
      {"trial_readings", [](const std::string& path) { data::ReadTrialReadings(path); }},
      {"live_stream", ReadLiveStream},
      {"wand", [](const std::string& path) { data::ReadWand(path); }},
      {"tracks_csv", [](const std::string& path) { data::ReadTracksCsv(path); }},
      {"gsi",
       [](const std::string& path) {
         data::ReadGsi(path, {1e-3, 1e-5, 1e-3});
       }},
      {"c3d", [](const std::string& path) { data::ReadTracksC3d(path, 1e-3); }},
      {"uff", [](const std::string& path) { data::ReadTracksUff(path, 1e-3); }},
      {"raw_binary",
       [](const std::string& path) { ReadRawLines(data::RawLayout::Format::kBinary, path); }},
      {"raw_csv",
       [](const std::string& path) { ReadRawLines(data::RawLayout::Format::kCsv, path); }},
      {"raw_png",
       [](const std::string& path) { ReadRawLines(data::RawLayout::Format::kPng, path); }},
      {"raw_lines_h5",
       [](const std::string& path) { ReadRawLines(data::RawLayout::Format::kHdf5, path); }},
      {"expression", ReadExpression},
      {"overrides", ReadOverrides},
      {"length", ReadLength},
      {"journal", ReadJournal},
      {"evaluation", ReadEvaluation},
      {"program_tracks", ReadAnswerOfProgram},
      {"info_h5", ReadInfo},
      {"run_h5", [](const std::string& path) { data::ReadRun(path); }},
      {"run_rows_h5", ReadRunRows},
      {"modes_h5", [](const std::string& path) { data::ReadModes(path); }},
      {"survey_h5", [](const std::string& path) { data::ReadSurvey(path); }},
      {"rig_h5", [](const std::string& path) { data::ReadRig(path); }},
      {"tracks_h5", [](const std::string& path) { data::ReadTracks(path); }},
      {"fit_h5", [](const std::string& path) { data::ReadFit(path); }},
      {"campaign_h5",
       [](const std::string& path) { campaign::Answer(campaign::ReadRecord(path)); }},
      {"readings_h5", [](const std::string& path) { data::ReadTrialReadings(path); }},
      {"trial_h5", ReadTrialBlocks}};
  return kReaders;
}

bool Try(const Reader& reader, const std::string& bytes) {
  const MemoryFile file(bytes, reader.name.ends_with("_h5"));
  try {
    reader.read(file.path());
  } catch (const Error&) {
    return false;
  }
  return true;
}

}  // namespace unfurl::fuzz

#include "data/tracks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/trial_health.h"

namespace unfurl::data {

namespace {

constexpr std::array<const char*, 6> kTracksCovariance = {"cxx", "cxy", "cxz", "cyy", "cyz", "czz"};
constexpr std::array<const char*, 4> kStatusNames = {"good", "three_cameras", "rejected_reading",
                                                     "unsolvable"};
constexpr std::array<const char*, kSampleReasons> kReasonNames = {"",
                                                                  "too few readings",
                                                                  "planes too near to parallel",
                                                                  "outside the volume",
                                                                  "readings disagree",
                                                                  "two points fit three readings",
                                                                  "ambiguous spots",
                                                                  "off its path"};

}  // namespace

const char* Name(SampleStatus status) { return kStatusNames[static_cast<std::size_t>(status)]; }

const char* Name(SampleReason reason) { return kReasonNames[static_cast<std::size_t>(reason)]; }

Eigen::Matrix3d Tracks::Covariance(std::size_t i) const {
  const auto c = cov.col(static_cast<Eigen::Index>(i));
  Eigen::Matrix3d C;
  C << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
  return C;
}

std::vector<std::size_t> Tracks::SamplesOf(std::int32_t mark_index) const {
  std::vector<std::size_t> samples;
  for (std::size_t i = 0; i < size(); ++i) {
    if (mark[i] == mark_index && Usable(status[i])) samples.push_back(i);
  }
  return samples;
}

int Tracks::FindMark(const std::string& name) const {
  const auto found = std::find(marks.begin(), marks.end(), name);
  return found == marks.end() ? -1 : static_cast<int>(found - marks.begin());
}

struct TracksWriter::Impl {
  H5Writer file;
  H5Series t, mark, p, cov, status, shared, used, left_out, reason;
  std::size_t rank;
  bool detailed;

  Impl(const std::string& path, const Tracks& like, const Provenance& provenance)
      : file(path, kTracksSchema, kTracksVersion, provenance),
        rank(static_cast<std::size_t>(like.shared_rank)),
        detailed(!like.cameras.empty()) {
    file.Write({"/marks", "1", "marks' names"}, like.marks);
    file.Attribute("/", "frame", like.frame);
    file.Attribute("/", "smoothed", static_cast<std::int64_t>(like.smoothed));
    file.Attribute("/", "shared_rank", static_cast<std::int64_t>(like.shared_rank));
    WriteAxisNames(file);
    WriteComponentNames(file);
    t = file.Series({"/t", "s", "time stamp of the sample"}, H5Type::kDouble);
    mark = file.Series({"/mark", "1", "index into marks", {"/t"}}, H5Type::kInt32);
    p = file.Series({"/p", "m", "x, y, z; NaN where unsolvable", {"/t", kAxisNames}},
                    H5Type::kDouble, {3});
    cov = file.Series(
        {"/cov", "m^2", "random covariance: xx, xy, xz, yy, yz, zz", {"/t", kComponentNames}},
        H5Type::kDouble, {6});
    status = file.Series(
        {"/status", "1", "0 good, 1 three cameras, 2 rejected reading, 3 unsolvable", {"/t"}},
        H5Type::kInt32);
    if (detailed) {
      file.Write({"/cameras", "1", "cameras' names"}, like.cameras);
      used = file.Series({"/used", "1", "bit c: a reading of camera c entered", {"/t"}},
                         H5Type::kInt32);
      left_out = file.Series(
          {"/left_out", "1", "bit c: camera c saw something that was not taken", {"/t"}},
          H5Type::kInt32);
      reason = file.Series({"/reason",
                            "1",
                            "why unsolvable: 1 too few readings, 2 parallel planes, 3 outside, "
                            "4 readings disagree, 5 two points fit, 6 ambiguous, 7 off its path",
                            {"/t"}},
                           H5Type::kInt32);
    }
    if (rank > 0) {
      file.BareScale("/direction", rank);
      // Seven digits of an uncertainty are plenty, and it is most of the file.
      shared = file.Series({"/shared",
                            "m",
                            "factor F: the calibration's error is F z, z ~ N(0, 1), one z for all",
                            {"/t", kAxisNames, "/direction"}},
                           H5Type::kFloat, {3, rank}, 256, 1);
    }
  }
};

TracksWriter::TracksWriter(const std::string& path, const Tracks& like,
                           const Provenance& provenance)
    : impl_(std::make_unique<Impl>(path, like, provenance)) {}

TracksWriter::~TracksWriter() = default;

void TracksWriter::Append(const Tracks& block) {
  const std::size_t n = block.size();
  impl_->t.Append(std::span<const double>(block.t));
  impl_->mark.Append(std::span<const std::int32_t>(block.mark));
  impl_->p.Append(std::span<const double>(block.p.data(), 3 * n));
  impl_->cov.Append(std::span<const double>(block.cov.data(), 6 * n));
  std::vector<std::int32_t> status(n);
  for (std::size_t i = 0; i < n; ++i) status[i] = static_cast<std::int32_t>(block.status[i]);
  impl_->status.Append(std::span<const std::int32_t>(status));
  if (impl_->detailed) {
    const auto append = [&status](H5Series& series, const auto& values) {
      for (std::size_t i = 0; i < status.size(); ++i) {
        status[i] = static_cast<std::int32_t>(values[i]);
      }
      series.Append(std::span<const std::int32_t>(status));
    };
    append(impl_->used, block.used);
    append(impl_->left_out, block.left_out);
    append(impl_->reason, block.reason);
  }
  if (impl_->rank == 0) return;
  // Columns of one sample lie side by side in memory, its rows on disk.
  const Eigen::Index k = static_cast<Eigen::Index>(impl_->rank);
  std::vector<float> rows(3 * impl_->rank * n);
  using RowMajor = Eigen::Matrix<float, 3, Eigen::Dynamic, Eigen::RowMajor>;
  for (std::size_t i = 0; i < n; ++i) {
    Eigen::Map<RowMajor>(&rows[3 * impl_->rank * i], 3, k) =
        block.shared.middleCols(static_cast<Eigen::Index>(i) * k, k).cast<float>();
  }
  impl_->shared.Append(std::span<const float>(rows));
}

void TracksWriter::Add(const TrialHealth& health) { WriteTrialHealth(health, &impl_->file); }

void TracksWriter::Commit() { impl_->file.Commit(); }

void WriteTracks(const std::string& path, const Tracks& tracks, const Provenance& provenance) {
  TracksWriter writer(path, tracks, provenance);
  writer.Append(tracks);
  writer.Commit();
}

namespace {

void CheckSizes(const H5Reader& file, const std::vector<std::int32_t>& status,
                const Tracks& tracks) {
  const std::size_t n = tracks.size();
  const std::size_t k = static_cast<std::size_t>(std::max(0, tracks.shared_rank));
  if (tracks.mark.size() != n || status.size() != n ||
      file.Dims("/p") != std::vector<std::size_t>{n, 3} ||
      file.Dims("/cov") != std::vector<std::size_t>{n, 6} ||
      (k > 0 && file.Dims("/shared") != std::vector<std::size_t>{n, 3, k})) {
    file.Fail("holds series of different lengths", "/t", "make the file again");
  }
}

// The samples' status, once marks, times and places are there to go with it.
void CheckStatus(const H5Reader& file, const std::vector<std::int32_t>& status, Tracks* tracks) {
  const int marks = static_cast<int>(tracks->marks.size());
  tracks->status.resize(tracks->size());
  for (std::size_t i = 0; i < tracks->size(); ++i) {
    if (status[i] < 0 || status[i] > 3 || tracks->mark[i] < 0 || tracks->mark[i] >= marks ||
        !std::isfinite(tracks->t[i])) {
      file.Fail(fmt::format("sample {} has an impossible status, mark or time", i), "/status",
                "make the file again");
    }
    tracks->status[i] = static_cast<SampleStatus>(status[i]);
    const Eigen::Index col = static_cast<Eigen::Index>(i);
    if (Usable(tracks->status[i]) &&
        !(tracks->p.col(col).allFinite() && tracks->cov.col(col).allFinite())) {
      file.Fail(fmt::format("sample {} is called {} but is not finite", i, Name(tracks->status[i])),
                "/p", "make the file again");
    }
  }
}

// Which cameras each sample used and left out, and why it is no better than it is.
void ReadDetails(const H5Reader& file, Tracks* tracks) {
  const std::size_t n = tracks->size();
  tracks->cameras = file.ReadStrings("/cameras");
  const std::vector<std::int32_t> used = file.ReadInts("/used");
  const std::vector<std::int32_t> left_out = file.ReadInts("/left_out");
  const std::vector<std::int32_t> reason = file.ReadInts("/reason");
  if (used.size() != n || left_out.size() != n || reason.size() != n) {
    file.Fail("holds series of different lengths", "/used", "make the file again");
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (reason[i] < 0 || reason[i] >= kSampleReasons) {
      file.Fail(fmt::format("sample {} has an impossible reason", i), "/reason",
                "make the file again");
    }
    tracks->used.push_back(static_cast<std::uint32_t>(used[i]));
    tracks->left_out.push_back(static_cast<std::uint32_t>(left_out[i]));
    tracks->reason.push_back(static_cast<SampleReason>(reason[i]));
  }
}

void ReadShared(const H5Reader& file, Tracks* tracks) {
  const std::size_t n = tracks->size(), k = static_cast<std::size_t>(tracks->shared_rank);
  const std::vector<double> rows = file.ReadDoubles("/shared", "m");
  tracks->shared.resize(3, static_cast<Eigen::Index>(n * k));
  using RowMajor = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Index rank = static_cast<Eigen::Index>(k);
  for (std::size_t i = 0; i < n; ++i) {
    tracks->shared.middleCols(static_cast<Eigen::Index>(i) * rank, rank) =
        Eigen::Map<const RowMajor>(&rows[3 * k * i], 3, rank);
  }
}

}  // namespace

Tracks ReadTracks(const std::string& path) {
  const H5Reader file(path, kTracksSchema, kTracksVersion);
  Tracks tracks;
  tracks.marks = file.ReadStrings("/marks");
  tracks.frame = file.StringAttribute("/", "frame");
  tracks.smoothed = file.IntAttribute("/", "smoothed") != 0;
  tracks.shared_rank = static_cast<int>(file.IntAttribute("/", "shared_rank"));
  tracks.t = file.ReadDoubles("/t", "s");
  tracks.mark = file.ReadInts("/mark");
  const std::vector<std::int32_t> status = file.ReadInts("/status");
  CheckSizes(file, status, tracks);
  tracks.p = file.ReadMatrix("/p", "m").transpose();
  tracks.cov = file.ReadMatrix("/cov", "m^2").transpose();
  CheckStatus(file, status, &tracks);
  if (file.Has("/cameras")) ReadDetails(file, &tracks);
  if (tracks.shared_rank > 0) ReadShared(file, &tracks);
  return tracks;
}

void WriteTracksCsv(const std::string& path, const Tracks& tracks) {
  std::vector<CsvColumn> columns = {{"t", "s"}, {"mark", ""}, {"x", "m"}, {"y", "m"}, {"z", "m"}};
  for (const char* name : kTracksCovariance) columns.push_back({name, "m^2"});
  columns.push_back({"status", ""});
  if (!tracks.reason.empty()) columns.push_back({"reason", ""});
  CsvWriter writer(columns);
  writer.Comment(fmt::format("frame: {}", tracks.frame));
  writer.Comment(fmt::format("smoothed: {}", tracks.smoothed ? "yes" : "no"));
  const auto cell = [](double v) { return std::isnan(v) ? std::string() : fmt::format("{}", v); };
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const Eigen::Index col = static_cast<Eigen::Index>(i);
    std::vector<std::string> cells = {cell(tracks.t[i]),
                                      tracks.marks[static_cast<std::size_t>(tracks.mark[i])]};
    for (Eigen::Index k = 0; k < 3; ++k) cells.push_back(cell(tracks.p(k, col)));
    for (Eigen::Index k = 0; k < 6; ++k) cells.push_back(cell(tracks.cov(k, col)));
    cells.emplace_back(Name(tracks.status[i]));
    if (!tracks.reason.empty()) cells.emplace_back(Name(tracks.reason[i]));
    writer.Row(cells);
  }
  WriteTextFile(path, writer.text());
}

namespace {

// The word of a line's status column; where there is none, whether the line has a place.
SampleStatus StatusOf(const CsvTable& table, std::size_t row, int column, int place) {
  const std::string word = column >= 0 ? table.Text(row, column) : std::string();
  if (word.empty()) {
    return table.Empty(row, place) ? SampleStatus::kUnsolvable : SampleStatus::kGood;
  }
  const auto found = std::find(kStatusNames.begin(), kStatusNames.end(), word);
  if (found == kStatusNames.end()) {
    throw Error(fmt::format("'{}' is no status", word), table.Where(row, column),
                "write good, three_cameras, rejected_reading or unsolvable");
  }
  return static_cast<SampleStatus>(found - kStatusNames.begin());
}

}  // namespace

Tracks ReadTracksCsv(const std::string& path) {
  const CsvTable table = CsvTable::Load(path);
  const std::size_t n = table.rows();
  if (n == 0) throw Error("holds no sample", path, "give one line per sample");
  const int t = table.Require("t", "s");
  const int mark = table.Require("mark", "");
  const std::array<int, 3> p = {table.Require("x", "m"), table.Require("y", "m"),
                                table.Require("z", "m")};
  std::array<int, 6> cov;
  for (std::size_t k = 0; k < 6; ++k) cov[k] = table.Require(kTracksCovariance[k], "m^2");
  const int status = table.Find("status");

  Tracks tracks;
  tracks.frame = "rig";
  for (const std::string& comment : table.comments()) {
    if (comment.starts_with("frame: ")) tracks.frame = comment.substr(7);
    if (comment == "smoothed: yes") tracks.smoothed = true;
  }
  tracks.p.resize(3, static_cast<Eigen::Index>(n));
  tracks.cov.resize(6, static_cast<Eigen::Index>(n));
  tracks.shared.resize(3, 0);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Index col = static_cast<Eigen::Index>(i);
    tracks.t.push_back(table.Number(i, t));
    const std::string name = table.Text(i, mark);
    if (name.empty()) throw Error("a sample without a mark", table.Where(i, mark), "name its mark");
    if (tracks.FindMark(name) < 0) tracks.marks.push_back(name);
    tracks.mark.push_back(tracks.FindMark(name));
    const SampleStatus s = StatusOf(table, i, status, p[0]);
    tracks.status.push_back(s);
    for (std::size_t k = 0; k < 9; ++k) {
      const int column = k < 3 ? p[k] : cov[k - 3];
      const double value =
          Usable(s) ? table.Number(i, column) : std::numeric_limits<double>::quiet_NaN();
      if (k < 3) {
        tracks.p(static_cast<Eigen::Index>(k), col) = value;
      } else {
        tracks.cov(static_cast<Eigen::Index>(k - 3), col) = value;
      }
    }
  }
  return tracks;
}

}  // namespace unfurl::data

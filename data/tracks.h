#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "data/provenance.h"

namespace unfurl::data {

struct TrialHealth;

// Where each sample of a track stands; the reason is the word itself.
enum class SampleStatus : std::int32_t {
  kGood = 0,             // four readings that agree
  kThreeCameras = 1,     // solved from three: nothing left over to check it with
  kRejectedReading = 2,  // four readings that disagree; one was left out
  kUnsolvable = 3,       // too few readings, or planes too near to parallel; position is NaN
};
const char* Name(SampleStatus status);
inline bool Usable(SampleStatus s) { return s != SampleStatus::kUnsolvable; }

// Why a sample has no position.
enum class SampleReason : std::int32_t {
  kNone = 0,       // it has one
  kTooFew = 1,     // fewer than three usable readings
  kParallel = 2,   // their planes are too near to parallel
  kOutside = 3,    // no point in or near the volume explains them
  kDisagree = 4,   // four readings that one point cannot explain: one is wrong, unknown which
  kTwoFit = 5,     // three readings that two points explain equally well
  kAmbiguous = 6,  // several spots could be the mark's
  kOffPath = 7,    // far from the predicted path, with no redundant reading to confirm it
};
inline constexpr int kSampleReasons = 8;  // how many there are
const char* Name(SampleReason reason);    // in words

// Marks in time, sample by sample in order of time; n samples of m marks.
//
// The error of sample i is  e_i = random_i + F_i z:  random_i has covariance cov_i and is
// independent between samples; F_i is the 3 x k factor `shared.block(0, i * k, 3, k)` of what the
// calibration's uncertainty does to it, and z ~ N(0, I_k) is one draw common to all samples.
struct Tracks {
  std::string frame;               // frame of p: "rig" (W of the survey) or "model"
  std::vector<std::string> marks;  // m names
  bool smoothed = false;           // a fit refuses smoothed tracks

  std::vector<double> t;                         // n, each sample's own time stamp [s]
  std::vector<std::int32_t> mark;                // n, index into `marks`
  Eigen::Matrix3Xd p;                            // 3 x n [m]
  Eigen::Matrix<double, 6, Eigen::Dynamic> cov;  // xx, xy, xz, yy, yz, zz by n [m^2]
  std::vector<SampleStatus> status;              // n
  int shared_rank = 0;                           // k
  Eigen::Matrix3Xd shared;                       // 3 x (n k) [m]

  // How each sample came about; `cameras` empty and so are the others where nobody knows.
  std::vector<std::string> cameras;     // c names
  std::vector<std::uint32_t> used;      // n, bit c: a reading of camera c entered
  std::vector<std::uint32_t> left_out;  // n, bit c: camera c's reading was rejected
  std::vector<SampleReason> reason;     // n

  // Number of samples.
  std::size_t size() const { return t.size(); }
  // Covariance of one sample's position, the calibration's part left out [m^2].
  Eigen::Matrix3d Covariance(std::size_t i) const;
  // Indices of the usable samples of one mark, in order of time.
  std::vector<std::size_t> SamplesOf(std::int32_t mark_index) const;
  // Index of a mark's name, or -1.
  int FindMark(const std::string& name) const;
};

inline constexpr char kTracksSchema[] = "unfurl/tracks";
inline constexpr int kTracksVersion = 2;  // 2: how samples came about

// Streams samples to disk in constant memory; the file gets its name on Commit. `like` gives frame,
// marks, cameras, `smoothed` and the shared rank; its samples, if any, are not written.
class TracksWriter {
 public:
  TracksWriter(const std::string& path, const Tracks& like, const Provenance& provenance);
  ~TracksWriter();
  // Samples go on where the last block ended, in order of time. Throws Error when the disk is full.
  void Append(const Tracks& block);
  // What the trial said of its cameras. Once at most.
  void Add(const TrialHealth& health);
  // Gives the file its name. Call once, last.
  void Commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

void WriteTracks(const std::string& path, const Tracks& tracks, const Provenance& provenance);
Tracks ReadTracks(const std::string& path);
// Columns t, mark, x, y, z, cxx .. czz, status, reason, with units in the header; no shared part.
void WriteTracksCsv(const std::string& path, const Tracks& tracks);
Tracks ReadTracksCsv(const std::string& path);

}  // namespace unfurl::data

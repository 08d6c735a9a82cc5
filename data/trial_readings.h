#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "data/provenance.h"

namespace unfurl::data {

/// Readings of a trial, by a recorder that finds spots itself: n flashes seen by c cameras, in
/// order of time. A flash is what was lit at one moment: one mark, or several together, of which
/// nobody says which reading is whose.
struct TrialReadings {
  std::string path;                  // where they came from, for messages
  std::vector<std::string> cameras;  // c names
  std::vector<int> pixels;           // c, of each camera's row; empty: not stated
  std::vector<std::string> slots;    // distinct: a mark, or several joined by '+'
  std::vector<double> t;             // n, middle of the flash; never falling [s]
  std::vector<std::int32_t> slot;    // n, index into `slots`
  std::size_t most = 1;              // k, room for readings of one camera in one flash
  std::vector<double> u_px, s_px;    // n x c x k, reading and its sigma, NaN after the last [px]

  std::size_t size() const { return t.size(); }  ///< n
  /// Of one flash and camera, k entries [px].
  std::span<const double> Readings(std::size_t flash, std::size_t camera) const {
    return {&u_px[(flash * cameras.size() + camera) * most], most};
  }
  /// Their standard deviations, k entries [px].
  std::span<const double> Sigmas(std::size_t flash, std::size_t camera) const {
    return {&s_px[(flash * cameras.size() + camera) * most], most};
  }
};

inline constexpr char kReadingsSchema[] = "unfurl/readings";
inline constexpr int kReadingsVersion = 1;
inline constexpr std::size_t kMostReadings = 8;  // of one camera in one flash

/// By content: HDF5; or CSV with `time [s]`, `mark` (a name, several joined by '+', or empty: all
/// marks of the comment `marks:` were lit), and either `u1 [px]`, `s1 [px]`, .. with a row for each
/// flash, or `camera`, `u [px]`, `s [px]` with a row for each reading; comments `cameras:` and
/// `pixels:` as in a survey. Rows of one time and mark are one flash. Throws Error with file and
/// line (or dataset) for what is no reading, or contradicts itself.
TrialReadings ReadTrialReadings(const std::string& path);
/// The file, HDF5. Throws Error where the machine refuses.
void WriteTrialReadings(const std::string& path, const TrialReadings& readings,
                        const Provenance& provenance);
/// The same as CSV, a row for each reading (a flash that nobody saw has one row without).
void WriteTrialReadingsCsv(const std::string& path, const TrialReadings& readings);

}  // namespace unfurl::data

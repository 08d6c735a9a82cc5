#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "data/line_format.h"
#include "data/provenance.h"

namespace unfurl::data {

// Standard deviations of what one station does to all of its points alike, by its data sheet or
// calibration; 0: none, or it is in the points' own sigmas.
struct StationErrors {
  double distance_offset = 0.0;  // also of the prism's constant [m]
  double distance_scale = 0.0;   // [1]; 1.5e-6 is 1.5 ppm
  double zenith = 0.0;           // index error of the vertical circle [rad]
};

// Points that a total station measured while each camera saw the LED that stood there: n points,
// c cameras. Readings come as numbers, or as raw lines from which `calibrate` finds them.
struct Survey {
  std::vector<std::string> id;                   // n, unique
  Eigen::Matrix3Xd p;                            // 3 x n, in the station's frame W [m]
  Eigen::Matrix<double, 6, Eigen::Dynamic> cov;  // xx, xy, xz, yy, yz, zz by n [m^2]
  // n labels: from which of several set-ups of the station a point was measured. Empty: from one.
  std::vector<std::string> set_up;
  std::vector<std::string> cameras;  // c names
  std::vector<int> pixels;           // c, of each camera's row; 0, or empty: not stated
  // Where the total station stood, in W [m]; NaN: not said.
  Eigen::Vector3d station = Eigen::Vector3d::Constant(NAN);
  StationErrors station_errors;
  std::vector<std::string> notes;  // what was made of the file, for the user. Not stored

  Eigen::MatrixXd u_px;  // n x c readings [px]; NaN: not seen. Empty (0 x 0) where there are lines
  Eigen::MatrixXd s_px;  // n x c standard deviations [px]; NaN where u is NaN

  // Raw lines, both n x (elements of each camera in turn), or both empty: with the LED lit, and
  // dark.
  LineFormats format;
  std::vector<std::uint16_t> lit;
  std::vector<std::uint16_t> dark;
  // Flat field of the active pixels, camera after camera [-]; empty: none was recorded.
  std::vector<float> response;

  // Number of points.
  std::size_t size() const { return id.size(); }
  // True where readings must still be found in raw lines.
  bool has_lines() const { return !lit.empty(); }
  std::size_t line_counts() const { return format.ElementsBefore(cameras.size()); }
  // Where one camera's line of a point begins in `lit` and `dark`.
  std::size_t LineAt(std::size_t point, std::size_t camera) const {
    return point * line_counts() + format.ElementsBefore(camera);
  }
};

inline constexpr char kSurveySchema[] = "unfurl/survey";
inline constexpr int kSurveyVersion = 3;  // 2: pixels of each camera; 3: set-ups, where there are

// By content: HDF5, or CSV with points (data/survey_points.h), then u1.. and s1.. (empty cells: not
// seen), each with its unit in the header, and the cameras' numbers of pixels as a comment
// "pixels: 2160, 4096" (one number: all alike).
Survey ReadSurvey(const std::string& path);
bool IsSurveyH5(const std::string& path);  // HDF5 at all, by its first bytes
void WriteSurvey(const std::string& path, const Survey& survey, const Provenance& provenance);
void WriteSurveyCsv(const std::string& path, const Survey& survey);  // readings only

// The points alone: id, coordinates and, if given, their sigmas.
Survey ReadPointsCsv(const std::string& path);

// The set-ups that points were measured from, in order of appearance; empty where none is said.
std::vector<std::string> SetUpNames(const Survey& survey);

}  // namespace unfurl::data

#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "data/csv.h"
#include "data/survey.h"

namespace unfurl::data {

// Points as total stations give them, into x, y, z of a right-handed frame with covariances [m].
//
// A CSV's columns may be `x, y, z`; or `E, N, H` in any order (E becomes x, N y, H z: the order
// N, E, H, which is left-handed as it stands, is so put right, and said); or `hz, v, d`: the
// direction clockwise from north, the angle from the zenith and the slope distance. If both
// coordinates and angles are there, the angles show whether the coordinates are left-handed.
// Comments give `station: E, N, H [m]`, `prism offset: d [m]` (added to each distance),
// `led offset: dE, dN, dH [m]` (from prism centre to LED); `distance error: OFFSET [m], SCALE` and
// `zenith error: SIGMA [rad]`, the sigmas of what all points share (StationErrors).
// A column `set_up` names the set-up that each point was measured from (data/set_ups.h).
// Fills id, set_up, p, cov, station and notes. False when no uncertainty is stated.
bool ReadSurveyPoints(const CsvTable& table, Survey* survey);

/// A table of points, in the order of its column `time` [s] where it has one: the order of
/// measuring, which is that of the file elsewhere.
CsvTable LoadSurveyTable(const std::string& path);

// What a station that states no uncertainty is taken to have.
struct StationSigmas {
  double coordinate = 0.0;  // per axis [m]; 0: not known
  double angle = 0.0;       // [rad]
  double distance = 0.0;    // [m]
};

// A Leica GSI-8 or GSI-16 file: point ids (word 11), and coordinates (81, 82, 83) or else angles
// and distance (21, 22, 31), with the station's place (84, 85, 86). Throws Error with file:line for
// what is not GSI, and where the sigmas that it needs are not given.
Survey ReadGsi(const std::string& path, const StationSigmas& sigmas);
bool LooksLikeGsi(const std::string& path);

/// Whether a file of points says which way round they are: by columns E, N, H, or by angles.
bool TellsHandedness(const std::string& path);

// A direction and a distance as a place relative to the station: E, N, H, and the derivatives by
// hz, v, d.
Eigen::Vector3d FromPolar(double hz, double v, double d, Eigen::Matrix3d* derivative = nullptr);

// Columns u1, s1, u2, s2, ... and the cameras that they are of, numbered.
struct ReadingColumns {
  std::vector<int> u, s;
  std::vector<std::string> cameras;
  std::vector<int> pixels;  // of each camera's row; empty: not stated
};
// Throws Error where a camera's readings and standard deviations stand for each other.
ReadingColumns FindReadingColumns(const CsvTable& table);
// "# pixels: 2160, 4096", or one number for all; empty where there is none. Throws Error for
// another number of numbers, and for what is no number of pixels.
std::vector<int> ReadPixels(const CsvTable& table, std::size_t cameras);
// "# cameras: a, b" names them; their pixels. Throws Error where that names more or fewer.
void NameCameras(const CsvTable& table, ReadingColumns* columns);
int PixelsOf(const ReadingColumns& columns, std::size_t camera);  // 0: not stated
// The reading in a row, NaN for two empty cells. Throws Error for half a reading, for a sigma that
// is not above 0, and for a place that is on no pixel of the row: `pixels` of them, 0 where that
// is not stated.
struct CellReading {
  double u_px, s_px;  // reading and its standard deviation [px]
};
CellReading ReadReading(const CsvTable& table, std::size_t row, int u_column, int s_column,
                        int pixels = 0);
// Whether a reading is on a row's pixels: 0 is the first one's middle.
bool OnRow(double u_px, int pixels);
// Whether a reading may have this standard deviation [px].
bool IsReadingSigma(double s_px);

// Points with the readings of another table, joined by id; what has no partner is left out and
// said.
struct ReadingTable {
  std::vector<std::string> id, cameras;
  std::vector<int> pixels;     // by camera; empty: not stated
  Eigen::MatrixXd u_px, s_px;  // id x camera [px]; NaN: not seen
  std::vector<std::string> notes;
};
// Repeats of readings by point and camera, in any order.
class ReadingRepeats {
 public:
  // Numbers of a point and of a camera, by order of appearance.
  std::size_t Point(const std::string& id) { return Index(&id_, id); }
  std::size_t Camera(const std::string& name) { return Index(&cameras_, name); }
  void Add(std::size_t point, std::size_t camera, double u_px, double s_px);
  // Their weighted means; where a camera's repeats scatter more than their sigmas say, and beyond
  // chance, its sigmas are widened to that.
  ReadingTable Average() const;

 private:
  static std::size_t Index(std::vector<std::string>* names, const std::string& name);

  std::vector<std::string> id_, cameras_;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<CellReading>> readings_;
};
// A CSV with `id` and either `u1 [px]`, `s1 [px]`, ... or `camera`, `u [px]`, `s [px]`. An id that
// comes again is a repeat: repeats are averaged, and where a camera's scatter more than their
// sigmas say, its sigmas are widened to that, and it is said.
ReadingTable ReadReadingsCsv(const std::string& path);
void JoinReadings(const ReadingTable& readings, const std::string& where, Survey* survey);

/// A survey whose readings may be in a file of their own (empty: they are in `path`), joined by id;
/// the points are CSV or GSI. `sigmas` is for files that state none. Throws Error as the readers
/// do.
Survey ReadSurveyInParts(const std::string& path, const std::string& readings,
                         const StationSigmas& sigmas);

}  // namespace unfurl::data

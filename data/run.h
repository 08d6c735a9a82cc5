#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "data/h5.h"
#include "data/provenance.h"

namespace unfurl::data {

// What a simulation leaves: sampled quantities, beam shapes, events, and a summary. Names and
// units: docs/formats.md; among them t, BODY.x/.y/.theta, JOINT.theta/.theta_rate/.contact_moment/
// .spring_moment, MARK.x/.y/.vx/.vy (in the model's plane), energy.*.
struct Quantity {
  std::string name;  // "hub.x"
  std::string units;
  std::string description;
};

// A latch, or the start or end of a contact, located in time.
struct RunEvent {
  double t = 0.0;                      // [s]
  std::string kind;                    // "latch", "contact_start", "contact_end"
  std::string where;                   // joint
  std::map<std::string, double> data;  // by name with unit: "theta_rate [rad/s]"
};

// What is kept for pictures, at a rate of its own.
enum class ShapeKind {
  kBeam,  // a centre line
  kBody,  // lines from its centre of mass to each point at which something holds on to it, and back
  kPin,   // a joint's place, one point
};
/// A beam, a body or a joint of which places are kept in time.
struct BeamShape {
  std::string name;
  // Of a beam: places of the points, from its start at rest [m]; else as many zeros as points.
  std::vector<double> at;
  ShapeKind kind = ShapeKind::kBeam;
};

// Everything a run will hold, declared before its first sample.
struct RunLayout {
  std::vector<Quantity> quantities;  // of a sample, without t, which every run has first
  std::vector<std::string> marks;    // names, in order; those whose .x and .y are sampled
  std::vector<BeamShape> shapes;
  std::vector<Quantity> event_data;         // what an event may carry
  std::vector<std::string> event_places;    // what `where` may say, for its width
  std::vector<Quantity> summary;            // numbers of the whole run; absent until set
  std::map<std::string, std::string> text;  // words that are known now, such as "scene"
};

inline constexpr char kRunSchema[] = "unfurl/run";
inline constexpr int kRunVersion = 2;  // 1: a dataset for each quantity, shape and number

// The times once more: xarray shows the series of a group with the coordinates of that group alone.
inline constexpr char kSeriesTime[] = "/series/t";

// Text "status" of a run that has not ended: one that still grows, or whose program was killed.
inline constexpr char kRunning[] = "running";

// Takes a run as it grows.
class RunSink {
 public:
  virtual ~RunSink() = default;
  // `values` in the order of RunLayout::quantities.
  virtual void Append(double t, std::span<const double> values) = 0;
  // The centre line of every beam in RunLayout::shapes: x, y of each point, beam after beam [m].
  virtual void AppendShapes(double t, std::span<const double> points) = 0;
  virtual void AddEvent(const RunEvent& event) = 0;
  // One number of RunLayout::summary: steps, evaluations, drift, impacts, ...
  virtual void SetSummary(const std::string& name, double value) = 0;
  // "status", "message", "method" or "stopped_by".
  virtual void SetText(const std::string& name, const std::string& text) = 0;
  // What was given so far is safe afterwards.
  virtual void Flush() {}
};

// Streams a run to NAME.partial in constant memory; it gets its name on Commit. The destructor
// alone removes it. What was given before a Flush stays should the program be killed.
class RunWriter : public RunSink {
 public:
  RunWriter(const std::string& path, const Provenance& provenance, RunLayout layout);
  ~RunWriter() override;
  void Append(double t, std::span<const double> values) override;
  void AppendShapes(double t, std::span<const double> points) override;
  void AddEvent(const RunEvent& event) override;
  void SetSummary(const std::string& name, double value) override;
  void SetText(const std::string& name, const std::string& text) override;
  void Flush() override;
  // Whether a sample has got to the disk.
  bool holds_samples() const;
  const std::string& partial() const;  // the file's name until Commit

  // Writes what is left and gives the file its name. Call once, last.
  void Commit();
  void Keep();     // instead: leaves NAME.partial
  void Abandon();  // the same after a failed write, as the last Flush left it

  // Bytes of a file of so many samples and shapes, events apart.
  static double FileSize(const RunLayout& layout, double samples, double shapes);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A beam, a body or a pin in time, as it was kept.
struct BeamMotion {
  std::string name;
  std::vector<double> at;  ///< by point, k of them, see BeamShape [m]
  std::vector<double> xy;  ///< x, y of every point at every time of Run::shape_t, s x k x 2 [m]
  ShapeKind kind = ShapeKind::kBeam;
};

// A simulated motion in memory: n samples of q quantities.
struct Run {
  std::vector<double> t;                     // n [s]
  std::vector<Quantity> quantities;          // q, without t
  std::vector<std::vector<double>> columns;  // q of n values each [Quantity::units]
  std::vector<std::string> marks;
  std::vector<RunEvent> events;
  std::map<std::string, double> summary;     // by name [Quantity::units of summary_quantities]
  std::vector<Quantity> summary_quantities;  // units and descriptions of those that may be there
  std::map<std::string, std::string> text;
  std::vector<double> shape_t;     // s [s]; none: no shapes were kept, or they were not read
  std::vector<BeamMotion> shapes;  // beams first, then bodies, then pins

  int Find(const std::string& name) const;                           // -1 when absent
  const std::vector<double>& Column(const std::string& name) const;  // throws Error when absent
};
// Keeps a run in memory: what ReadRun gives of the file that a RunWriter would have made, shapes
// included.
class RunInMemory : public RunSink {
 public:
  explicit RunInMemory(const RunLayout& layout);
  void Append(double t, std::span<const double> values) override;
  void AppendShapes(double t, std::span<const double> points) override;
  void AddEvent(const RunEvent& event) override { run_.events.push_back(event); }
  void SetSummary(const std::string& name, double value) override { run_.summary[name] = value; }
  void SetText(const std::string& name, const std::string& text) override;
  /// Moves the run out; the recorder is empty then.
  Run Take() { return std::move(run_); }

 private:
  Run run_;
};

/// "beam", "body" or "pin".
const char* ShapeKindName(ShapeKind kind);
/// Times of the shapes, and their points.
inline constexpr char kShapeTime[] = "/shapes/t", kShapePoints[] = "/shapes/xy";

/// A number of the whole run; NaN: not known.
struct SummaryNumber {
  Quantity of;
  double value = 0.0;  ///< [Quantity::units]
};
/// All that a run's file has of them, in its order. Throws Error where its columns differ in
/// length.
std::vector<SummaryNumber> ReadSummary(const H5Reader& file);

// Of a run that did not end: as much as all its series have. `with_shapes`: those too, which may be
// most of the file.
Run ReadRun(const std::string& path, bool with_shapes = false);
// The file that ReadRun reads, whole or not at all.
void WriteRun(const std::string& path, const Run& run, const Provenance& provenance);

/// The samples of a run, block by block, for files larger than memory.
class RunReader {
 public:
  explicit RunReader(const std::string& path);
  // What a sample holds, without t; how many samples; whether the simulation ended by itself; the
  // file.
  const std::vector<Quantity>& quantities() const { return quantities_; }
  std::size_t samples() const { return samples_; }
  bool ended() const { return ended_; }
  const H5Reader& file() const { return file_; }
  /// Index into quantities(); -1: the run has none of that name.
  int Find(const std::string& name) const;
  /// `out.size()` values of a quantity, from sample `first` [its unit]. They may not be finite.
  void ReadColumn(int quantity, std::size_t first, std::span<double> out) const;
  // `count` samples from `first`: t, and one column per quantity. Throws Error for times that do
  // not rise and for values that are not finite.
  void Read(std::size_t first, std::size_t count, std::vector<double>* t,
            std::vector<std::vector<double>>* columns) const;

  /// Names, kinds and points of the shapes, beams first; empty where none were kept.
  const std::vector<BeamShape>& shapes() const { return shapes_; }
  /// Times of the shapes, s [s].
  const std::vector<double>& shape_times() const { return shape_t_; }
  /// x, y of every point of every shape, shape after shape, at `count` of those times [m].
  void ReadShapes(std::size_t first, std::size_t count, std::vector<double>* xy) const;

 private:
  struct Place {
    std::string path;  // of a dataset
    int column;        // -1: it has but one, as in version 1
  };
  std::vector<std::string> FindSeries();
  std::vector<std::string> FindTables();
  void FindShapes();
  void FindShapesOfVersion1();
  void ReadTable(const std::string& path, std::size_t first, std::size_t count,
                 std::vector<std::vector<double>>* columns) const;

  H5Reader file_;
  std::vector<Quantity> quantities_;
  std::vector<Place> places_;                                 // by quantity
  std::map<std::string, std::vector<std::size_t>> of_table_;  // quantities by column
  std::size_t samples_ = 0;
  bool ended_ = true;
  std::vector<BeamShape> shapes_;
  std::vector<double> shape_t_;
};

}  // namespace unfurl::data

#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "data/provenance.h"

namespace unfurl::data {

// HDF5 behind the few calls that the records need. Every dataset carries the attributes `units`
// and `description`; every file the root attributes `schema`, `schema_version` and its provenance.

// Element types of datasets.
enum class H5Type { kDouble, kFloat, kInt32, kUint16, kUint8 };

// Names a dataset and says what it holds.
struct H5Field {
  std::string path;         // "/series/hub.x"; groups are made as needed
  std::string units;        // "m", "rad", "s", "px", "1" for none
  std::string description;  // one line
  // By dimension: path of the dataset that labels it (times, names), in the same group or one above
  // it. All dimensions or none: netCDF4 cannot read what has both kinds. Letters of text are no
  // dimension here.
  std::vector<std::string> scales;
};

class H5Writer;

// A dataset that grows by rows, in constant memory.
class H5Series {
 public:
  H5Series() = default;
  std::size_t rows() const { return rows_; }  // appended so far
  // `values` holds rows x (product of the row's dimensions) entries, row after row. The type must
  // be the one the series was made with.
  void Append(std::span<const double> values);
  void Append(std::span<const float> values);
  void Append(std::span<const std::int32_t> values);
  void Append(std::span<const std::uint16_t> values);
  void Append(std::span<const std::uint8_t> values);
  void Append(const std::vector<std::string>& values);  // of a text series; cut to its width

 private:
  friend class H5Writer;
  void AppendRaw(const void* values, std::size_t count, H5Type type);
  void AppendRows(const void* values, std::size_t count, std::int64_t memory_type);
  void WriteRows(const void* values, std::size_t first, std::size_t from, std::size_t to,
                 std::int64_t memory_type);
  H5Writer* writer_ = nullptr;
  std::int64_t dataset_ = -1;
  H5Type type_ = H5Type::kDouble;
  std::string path_;
  std::vector<std::size_t> row_;  // dimensions of one row; empty for scalars
  std::size_t width_ = 0;         // of text; 0: numbers
  std::size_t rows_ = 0;
  std::size_t packed_rows_ = 0;  // of a chunk that is packed here; 0: HDF5 packs
};

// Writes one file: datasets with units, attributes, provenance. Not for several threads at once.
class H5Writer {
 public:
  // How a file comes to be: whole or not at all; or streamed to NAME.partial, which can be read
  // while it grows and after the program was killed (HDF5's single-writer mode: from StartStreaming
  // on, nothing is lost but what came after the last Flush; chunks carry checksums).
  enum class Mode { kWhole, kStreamed };

  // `schema` such as "unfurl/run". Creates the temporary file; nothing bears the name `path` until
  // Commit. Throws Error (kMachine for a full disk or a refused permission).
  H5Writer(const std::string& path, const std::string& schema, int schema_version,
           const Provenance& provenance, Mode mode = Mode::kWhole);
  ~H5Writer();
  H5Writer(const H5Writer&) = delete;
  H5Writer& operator=(const H5Writer&) = delete;

  // A whole dataset; `dims` empty means one dimension of values.size().
  void Write(const H5Field& field, std::span<const double> values,
             std::vector<std::size_t> dims = {});
  void Write(const H5Field& field, std::span<const std::int32_t> values,
             std::vector<std::size_t> dims = {});
  void Write(const H5Field& field, std::span<const std::uint16_t> values,
             std::vector<std::size_t> dims = {});
  void Write(const H5Field& field, const Eigen::MatrixXd& matrix);  // rows x cols, C order on disk
  void Write(const H5Field& field, const std::vector<std::string>& values);

  // A growing dataset: rows of `row_dims` (empty: scalars); chunk of `chunk_rows`, and of at most
  // `chunk_columns` of the rows' first dimension (0: all); `deflate` 0..9.
  H5Series Series(const H5Field& field, H5Type type, const std::vector<std::size_t>& row_dims = {},
                  std::size_t chunk_rows = 1024, int deflate = 0, std::size_t chunk_columns = 0);

  // The same of text, each entry of fixed width.
  H5Series TextSeries(const H5Field& field, std::size_t width, std::size_t chunk_rows = 1024);

  // A scale that only names a dimension: letters of words, columns.
  void BareScale(const std::string& path, std::size_t size);

  // Of a streamed file, once every dataset and attribute is there: from here on series grow and
  // Overwrite replaces values, and nothing else is made.
  void StartStreaming();
  void Overwrite(const std::string& dataset, std::span<const double> values);
  void OverwriteText(const std::string& dataset, const std::string& value);
  void Flush();

  // Attributes of a group or dataset ("/" for the root; groups are made as needed).
  void Attribute(const std::string& object, const std::string& name, const std::string& value);
  void Attribute(const std::string& object, const std::string& name, double value);
  void Attribute(const std::string& object, const std::string& name, std::int64_t value);

  // Flushes, closes, syncs and renames. Call once, last.
  void Commit();
  // Instead of Commit: closes NAME.partial and leaves it there. The destructor alone removes it.
  void Keep();
  // The same after a failed write: NAME.partial stays as the last Flush left it.
  void Abandon();
  const std::string& temporary() const;  // the name until Commit

 private:
  friend class H5Series;
  void CloseAll();
  void AttachScales();
  void LabelLetters();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Names that label the dimensions of points and of their covariances: /axis and /component.
void WriteAxisNames(H5Writer& file);
void WriteComponentNames(H5Writer& file);
inline constexpr char kAxisNames[] = "/axis", kComponentNames[] = "/component";

// Reads one file, whole datasets or rows of them.
class H5Reader {
 public:
  // Throws one clear Error for: no such file, not HDF5, truncated, another schema, a newer version.
  // Empty `schema`: any HDF5 file, of other programs too.
  H5Reader(const std::string& path, const std::string& schema, int newest_version);
  ~H5Reader();
  H5Reader(const H5Reader&) = delete;
  H5Reader& operator=(const H5Reader&) = delete;

  // The schema of any Unfurl file; throws Error when it is not one.
  static std::string SchemaOf(const std::string& path);

  const std::string& path() const;    // of the file
  int schema_version() const;         // of the file, at most `newest_version`
  Provenance ReadProvenance() const;  // who made the file, from what

  bool Has(const std::string& path) const;                            // a group or dataset
  std::vector<std::string> Children(const std::string& group) const;  // by creation order
  bool IsDataset(const std::string& path) const;                      // false for a group
  std::vector<std::size_t> Dims(const std::string& dataset) const;    // rows first
  std::string Units(const std::string& dataset) const;                // "1" for none
  std::string Description(const std::string& dataset) const;          // one line

  // Whole datasets. `units` must equal the stored ones (empty: not checked). Non-finite values are
  // let through: NaN marks "not seen" in some fields; each record checks its own.
  std::vector<double> ReadDoubles(const std::string& dataset, const std::string& units = {}) const;
  std::vector<std::int32_t> ReadInts(const std::string& dataset) const;
  std::vector<std::string> ReadStrings(const std::string& dataset) const;
  Eigen::MatrixXd ReadMatrix(const std::string& dataset, const std::string& units = {}) const;

  // `count` rows from `first`, into `out` (count x row size entries).
  void ReadRows(const std::string& dataset, std::size_t first, std::size_t count,
                std::span<double> out) const;
  void ReadRows(const std::string& dataset, std::size_t first, std::size_t count,
                std::span<std::uint16_t> out) const;
  void ReadRows(const std::string& dataset, std::size_t first, std::size_t count,
                std::span<std::int32_t> out) const;

  // Entries of one column of a matrix, from row `first`, as many as `out` has.
  void ReadColumn(const std::string& dataset, std::size_t column, std::size_t first,
                  std::span<double> out) const;

  // All attributes of a group or dataset as text, by name.
  std::vector<std::pair<std::string, std::string>> Attributes(const std::string& object) const;
  bool HasAttribute(const std::string& object, const std::string& name) const;
  std::string StringAttribute(const std::string& object, const std::string& name) const;
  double DoubleAttribute(const std::string& object, const std::string& name) const;
  std::int64_t IntAttribute(const std::string& object, const std::string& name) const;

  // An Error that names this file and the dataset or attribute.
  [[noreturn]] void Fail(const std::string& what, const std::string& object,
                         const std::string& remedy) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace unfurl::data

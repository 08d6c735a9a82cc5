#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/run.h"
#include "report/chart.h"

namespace unfurl::cli {

// Columns of a run by name, thinned to what a chart can show; read block by block, so that a run of
// any length takes the same memory.
class RunColumns {
 public:
  explicit RunColumns(const std::string& path) : reader_(path) {}

  const data::RunReader& reader() const { return reader_; }
  const data::H5Reader& file() const { return reader_.file(); }
  bool Has(const std::string& name) const { return reader_.Find(name) >= 0; }

  // The least and the largest value of every bucket in time order, so that no peak is lost, times
  // `factor`; `shown` is the series' name.
  report::Series Read(const std::string& name, const std::string& shown, double factor) const;

  // Values at even steps, the same samples of every column; "t" is the time.
  std::vector<double> Thin(const std::string& name) const;

 private:
  void ReadInto(const std::string& name, std::size_t first, std::span<double> out) const;

  data::RunReader reader_;
};

}  // namespace unfurl::cli

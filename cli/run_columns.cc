#include "cli/run_columns.h"

#include <algorithm>
#include <span>

namespace unfurl::cli {

namespace {

constexpr std::size_t kRunColumnsShown = 1000;       // buckets along a chart
constexpr std::size_t kRunColumnsBlockRows = 65536;  // read at once

}  // namespace

report::Series RunColumns::Read(const std::string& name, const std::string& shown,
                                double factor) const {
  report::Series out;
  out.name = shown;
  const std::size_t all = reader_.samples(), bucket = all / kRunColumnsShown + 1;
  const std::size_t block = bucket * std::max<std::size_t>(1, kRunColumnsBlockRows / bucket);
  std::vector<double> t(block), v(block);
  for (std::size_t first = 0; first < all; first += block) {
    const std::size_t count = std::min(block, all - first);
    reader_.file().ReadRows("/t", first, count, std::span<double>(t));
    ReadInto(name, first, std::span<double>(v).first(count));
    for (std::size_t i = 0; i < count; i += bucket) {
      const auto begin = v.begin() + static_cast<std::ptrdiff_t>(i);
      const auto end = v.begin() + static_cast<std::ptrdiff_t>(std::min(i + bucket, count));
      const auto [low, high] = std::minmax_element(begin, end);
      for (const auto at : {std::min(low, high), std::max(low, high)}) {
        const double time = t[static_cast<std::size_t>(at - v.begin())];
        if (!out.x.empty() && time <= out.x.back()) continue;
        out.x.push_back(time);
        out.y.push_back(factor * *at);
      }
    }
  }
  return out;
}

void RunColumns::ReadInto(const std::string& name, std::size_t first, std::span<double> out) const {
  const int quantity = reader_.Find(name);
  if (quantity < 0) {
    reader_.file().Fail("has no quantity '" + name + "'", "", "`unfurl info` lists what it has");
  }
  reader_.ReadColumn(quantity, first, out);
}

std::vector<double> RunColumns::Thin(const std::string& name) const {
  const std::size_t all = reader_.samples(), step = all / kRunColumnsShown + 1;
  const std::size_t block = step * std::max<std::size_t>(1, kRunColumnsBlockRows / step);
  std::vector<double> v(block), out;
  for (std::size_t first = 0; first < all; first += block) {
    const std::size_t count = std::min(block, all - first);
    const std::span<double> block_of(v.data(), count);
    if (name == "t") {
      reader_.file().ReadRows("/t", first, count, block_of);
    } else {
      ReadInto(name, first, block_of);
    }
    for (std::size_t i = 0; i < count; i += step) out.push_back(v[i]);
  }
  return out;
}

}  // namespace unfurl::cli

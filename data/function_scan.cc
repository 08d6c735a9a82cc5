#include "data/function_scan.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "data/time_function_impl.h"

namespace unfurl::data {
namespace {

constexpr std::size_t kMostLikely = 1024;  // cells: room made at once
constexpr int kFirstCells = 16;            // as integrals of drives begin with
// Of the duration: cells that are not halved any more. A double of the time has 2e-16.
constexpr double kShortestCell = 1e-13;
// Of a cubic through both ends with its slopes: |f - p| <= h^4 |f''''| / 384.
constexpr double kCubic = 1.0 / 384.0;

class FunctionScanner {
 public:
  FunctionScanner(const TimeFunction::Impl& function, int derivative, double duration)
      : function_(function), derivative_(derivative), shortest_(kShortestCell * duration) {}

  FunctionScan Scan(std::vector<double> ends, double part, std::size_t most) {
    if (!function_.Bound(0.0, 0.0, derivative_)) return {};
    std::vector<double> middles;
    middles.reserve(kMostLikely);
    heap_.reserve(kMostLikely);
    for (std::size_t k = 0; k + 1 < ends.size(); ++k) {
      middles.push_back(At(0.5 * (ends[k] + ends[k + 1])));
    }
    out_.low = *std::min_element(middles.begin(), middles.end());
    out_.high = *std::max_element(middles.begin(), middles.end());
    std::nth_element(middles.begin(), middles.begin() + middles.size() / 2, middles.end());
    usual_ = middles[middles.size() / 2];
    for (std::size_t k = 0; k + 1 < ends.size(); ++k) Add(ends[k], ends[k + 1]);
    while (heap_.front().hidden > part * out_.area && heap_.size() < most) {
      std::pop_heap(heap_.begin(), heap_.end(), HidesLess);
      const FunctionScan::Cell cell = heap_.back();
      heap_.pop_back();
      const double middle = 0.5 * (cell.begin + cell.end);
      out_.area -= Area(cell.begin, cell.end);
      Add(cell.begin, middle);
      Add(middle, cell.end);
    }
    out_.hidden = heap_.front().hidden;
    std::sort(heap_.begin(), heap_.end(),
              [](const auto& a, const auto& b) { return a.begin < b.begin; });
    out_.cells = std::move(heap_);
    return std::move(out_);
  }

 private:
  static bool HidesLess(const FunctionScan::Cell& a, const FunctionScan::Cell& b) {
    return a.hidden < b.hidden;
  }

  // What is not finite is no matter of the scan.
  double At(double t) const {
    const TimeValue v = function_.At(t);
    const double value = derivative_ == 0 ? v.value : derivative_ == 1 ? v.rate : v.acceleration;
    return std::isfinite(value) ? value : 0.0;
  }
  double Area(double begin, double end) {
    const double value = At(0.5 * (begin + end));
    out_.low = std::min(out_.low, value);
    out_.high = std::max(out_.high, value);
    return (end - begin) * std::fabs(value - usual_);
  }

  void Add(double begin, double end) {
    const double h = end - begin;
    // At its ends branches may change.
    const auto bounds =
        *function_.Bound(std::nextafter(begin, end), std::nextafter(end, begin), derivative_);
    const double cubic = kCubic * h * h * h * h * bounds.fourth;
    const double off = std::min(bounds.high - bounds.low, cubic);
    heap_.push_back({begin, end, h > shortest_ ? h * off : 0.0});
    std::push_heap(heap_.begin(), heap_.end(), HidesLess);
    out_.area += Area(begin, end);
  }

  const TimeFunction::Impl& function_;
  const int derivative_;
  const double shortest_;  // [s]
  double usual_ = 0.0;     // value [unit]
  FunctionScan out_;
  std::vector<FunctionScan::Cell> heap_;
};

}  // namespace

FunctionScan TimeFunction::Impl::Scan(int derivative, double duration, double part,
                                      std::size_t most) const {
  std::vector<double> ends = Edges(duration);
  ends.reserve(ends.size() + kMostLikely);
  for (int k = 0; k <= kFirstCells; ++k) ends.push_back(duration * k / kFirstCells);
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  return FunctionScanner(*this, derivative, duration).Scan(std::move(ends), part, most);
}

FunctionScan TimeFunction::Scan(int derivative, double duration, double part,
                                std::size_t most) const {
  return impl_->Scan(derivative, duration, part, most);
}

}  // namespace unfurl::data

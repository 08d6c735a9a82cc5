#include "data/time_function.h"

namespace unfurl::data {

struct TimeFunction::Impl {
  double constant = 0.0;
  double slope = 0.0;
};

TimeFunction::TimeFunction(double constant)
    : impl_(std::make_shared<const Impl>(Impl{constant, 0.0})) {}

TimeValue TimeFunction::At(double t) const {
  return {impl_->constant + impl_->slope * t, impl_->slope, 0.0};
}

TimeFunction TimeFunction::Integral(double start, double) const {
  TimeFunction f;
  f.impl_ = std::make_shared<const Impl>(Impl{start, impl_->constant});
  return f;
}

bool TimeFunction::is_constant() const { return impl_->slope == 0.0; }

}  // namespace unfurl::data

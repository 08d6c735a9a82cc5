#include "data/time_function.h"

namespace unfurl::data {

struct TimeFunction::Impl {
  double constant = 0.0;
};

TimeFunction::TimeFunction(double constant)
    : impl_(std::make_shared<const Impl>(Impl{constant})) {}

TimeValue TimeFunction::At(double) const { return {impl_->constant, 0.0, 0.0}; }

bool TimeFunction::is_constant() const { return true; }

}  // namespace unfurl::data

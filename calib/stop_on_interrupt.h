#pragma once

#include <ceres/iteration_callback.h>

#include "base/progress.h"

namespace unfurl::calib {

/// Ends a solver of Ceres when the user has interrupted; ThrowIfInterrupted() is to be called after
/// it.
class StopOnInterrupt : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    return InterruptRequested() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }
};

}  // namespace unfurl::calib

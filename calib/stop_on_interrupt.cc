#include "calib/stop_on_interrupt.h"

#include <ceres/iteration_callback.h>

#include "base/progress.h"

namespace unfurl::calib {

namespace {

class Stop : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    return InterruptRequested() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }
};

}  // namespace

std::unique_ptr<ceres::IterationCallback> StopOnInterrupt() { return std::make_unique<Stop>(); }

}  // namespace unfurl::calib

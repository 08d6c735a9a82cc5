#pragma once

#include <memory>

namespace ceres {
class IterationCallback;
}

namespace unfurl::calib {

/// Ends a solver of Ceres when the user has interrupted; ThrowIfInterrupted() is to be called after
/// it.
std::unique_ptr<ceres::IterationCallback> StopOnInterrupt();

}  // namespace unfurl::calib

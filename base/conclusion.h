#pragma once

namespace unfurl {

// While one lives, an interrupt that has come is not asked for, so that what says how the work
// ended can still be written. A second signal, or the end of the time for stopping, ends the
// program as ever.
class Conclusion {
 public:
  Conclusion();
  ~Conclusion();
  Conclusion(const Conclusion&) = delete;
  Conclusion& operator=(const Conclusion&) = delete;
};

}  // namespace unfurl

#pragma once

namespace unfurl::calib {

// While it lives, what OpenMP would share out among threads its own thread does. CHOLMOD wakes four
// threads for each of its small blocks, whatever OMP_NUM_THREADS says: with chains of poses that is
// two million calls of the kernel, and half of the time.
class SerialOpenMp {
 public:
  SerialOpenMp();
  ~SerialOpenMp();
  SerialOpenMp(const SerialOpenMp&) = delete;
  SerialOpenMp& operator=(const SerialOpenMp&) = delete;

 private:
  int before_ = 0;  // levels of OpenMP that may be at work
};

}  // namespace unfurl::calib

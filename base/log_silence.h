#pragma once

namespace unfurl {

/// While one of these lives, Ceres' logging library (glog) writes nothing below a fatal fault: what
/// a solver has to say is in its summary, and the terminal is the program's. What the host program
/// had set is put back by the last one. From any thread.
class LogSilence {
 public:
  LogSilence();
  ~LogSilence();
  LogSilence(const LogSilence&) = delete;
  LogSilence& operator=(const LogSilence&) = delete;
};

}  // namespace unfurl

#include "base/log_silence.h"

#include <glog/logging.h>

#include <mutex>

namespace unfurl {

namespace {

std::mutex g_mutex;
int g_silences = 0;
int g_level = 0;  // of the host

}  // namespace

LogSilence::LogSilence() {
  const std::lock_guard<std::mutex> lock(g_mutex);
  if (g_silences++ > 0) return;
  g_level = FLAGS_minloglevel;
  FLAGS_minloglevel = google::GLOG_FATAL;
}

LogSilence::~LogSilence() {
  const std::lock_guard<std::mutex> lock(g_mutex);
  if (--g_silences == 0) FLAGS_minloglevel = g_level;
}

}  // namespace unfurl

#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace unfurl::cli {

// Bytes of a recorder as they come: of standard input, or of one client of a TCP port.
class LiveSource {
 public:
  enum class Got { kBytes, kNothing, kEnd };

  // Standard input. Throws Error where it is a terminal.
  LiveSource();
  // A port, as HOST:PORT; 0 takes a free one. Throws Error where it cannot be had.
  explicit LiveSource(const std::string& address);
  ~LiveSource();
  LiveSource(const LiveSource&) = delete;
  LiveSource& operator=(const LiveSource&) = delete;

  const std::string& where() const { return where_; }  // for messages: "standard input"
  bool connected() const { return data_ >= 0; }
  // Waits for bytes, or for the client, at most so long. The first client is the only one: others
  // are refused from then on. Throws Error where the line breaks.
  Got Read(int wait_ms, std::string_view* bytes);

 private:
  std::string where_;
  int listen_ = -1, data_ = -1;  // file descriptors
  std::vector<char> buffer_;
};

// A connection to HOST:PORT. Throws Error where nobody listens.
int ConnectTo(const std::string& address);

}  // namespace unfurl::cli

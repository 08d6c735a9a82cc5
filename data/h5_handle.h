#pragma once

#include <hdf5.h>

#include <string>
#include <utility>
#include <vector>

namespace unfurl::data {

// Owns one HDF5 identifier.
class H5Handle {
 public:
  using CloseFunction = herr_t (*)(hid_t);
  H5Handle() = default;
  H5Handle(hid_t id, CloseFunction close) : id_(id), close_(close) {}
  H5Handle(H5Handle&& other) noexcept { *this = std::move(other); }
  H5Handle& operator=(H5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~H5Handle() { Close(); }
  hid_t get() const { return id_; }
  bool valid() const { return id_ >= 0; }
  bool Close() {
    if (id_ < 0) return true;
    const herr_t result = close_(std::exchange(id_, -1));
    return result >= 0;
  }

 private:
  hid_t id_ = -1;
  CloseFunction close_ = nullptr;
};

// Switches off the library's printing of its error stack; call before anything else.
void H5Quiet();
// The innermost message of the library's error stack, and the errno that it mentions (0: none).
std::string H5LastMessage(int* error_number);

H5Handle H5Text(std::size_t width);  // UTF-8, padded with NUL

}  // namespace unfurl::data

#pragma once

#include <cstdint>
#include <random>
#include <string_view>

namespace unfurl {

// A seeded generator that is passed in wherever randomness is used; there is no global one. The
// draws are the same on every machine: the standard library's distributions are not used, since
// they differ between implementations.
class Rng {
 public:
  // Equal seeds give equal draws.
  explicit Rng(std::uint64_t seed);

  // An independent stream for a named purpose, so that switching one effect on or off leaves the
  // draws of all others as they were.
  Rng Stream(std::string_view purpose, std::uint64_t index = 0) const;

  double Uniform();                            // in [0, 1)
  double Uniform(double low, double high);     // in [low, high)
  double Normal();                             // mean 0, variance 1
  std::uint64_t Integer(std::uint64_t bound);  // in [0, bound)
  // Photon counts: exact below a mean of 30 (inversion), rounded normal with the exact mean and
  // variance above, where the two differ by less than any count's own scatter.
  double Poisson(double mean);

 private:
  std::uint64_t seed_;
  std::mt19937_64 engine_;
  double spare_ = 0.0;  // second normal draw of the last pair [-]
  bool has_spare_ = false;
};

}  // namespace unfurl

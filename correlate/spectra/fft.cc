#include "correlate/spectra/fft.h"

#include <fftw3.h>

#include <algorithm>
#include <memory>
#include <mutex>

namespace unfurl::correlate {

namespace {

// FFTW's planner is not thread-safe; its executor is.
std::mutex& PlannerMutex() {
  static std::mutex mutex;
  return mutex;
}

struct FftwFree {
  void operator()(void* p) const { fftw_free(p); }
};
using RealBuffer = std::unique_ptr<double, FftwFree>;
using ComplexBuffer = std::unique_ptr<fftw_complex, FftwFree>;

class Plan {
 public:
  explicit Plan(fftw_plan plan) : plan_(plan) {}
  ~Plan() {
    const std::lock_guard<std::mutex> lock(PlannerMutex());
    fftw_destroy_plan(plan_);
  }
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;
  void Run() const { fftw_execute(plan_); }

 private:
  fftw_plan plan_;
};

}  // namespace

std::vector<std::complex<double>> RealFft(std::span<const double> x) {
  const std::size_t n = x.size(), half = n / 2 + 1;
  if (n == 0) return {};
  RealBuffer in(fftw_alloc_real(n));
  ComplexBuffer out(fftw_alloc_complex(half));
  fftw_plan raw;
  {
    const std::lock_guard<std::mutex> lock(PlannerMutex());
    raw = fftw_plan_dft_r2c_1d(static_cast<int>(n), in.get(), out.get(), FFTW_ESTIMATE);
  }
  const Plan plan(raw);
  std::copy(x.begin(), x.end(), in.get());
  plan.Run();
  std::vector<std::complex<double>> X(half);
  for (std::size_t k = 0; k < half; ++k) X[k] = {out.get()[k][0], out.get()[k][1]};
  return X;
}

std::vector<double> InverseRealFft(std::span<const std::complex<double>> X, std::size_t n) {
  if (n == 0) return {};
  ComplexBuffer in(fftw_alloc_complex(n / 2 + 1));
  RealBuffer out(fftw_alloc_real(n));
  fftw_plan raw;
  {
    const std::lock_guard<std::mutex> lock(PlannerMutex());
    raw = fftw_plan_dft_c2r_1d(static_cast<int>(n), in.get(), out.get(), FFTW_ESTIMATE);
  }
  const Plan plan(raw);
  for (std::size_t k = 0; k <= n / 2; ++k) {
    in.get()[k][0] = X[k].real();
    in.get()[k][1] = X[k].imag();
  }
  plan.Run();
  std::vector<double> x(out.get(), out.get() + n);
  for (double& v : x) v /= static_cast<double>(n);
  return x;
}

std::size_t FastLength(std::size_t n) {
  for (std::size_t m = std::max<std::size_t>(n, 1);; ++m) {
    std::size_t rest = m;
    for (std::size_t p : {2u, 3u, 5u}) {
      while (rest % p == 0) rest /= p;
    }
    if (rest == 1) return m;
  }
}

std::vector<double> CrossCorrelation(std::span<const double> x, std::span<const double> y) {
  if (x.empty() || y.empty()) return {};
  const std::size_t lags = x.size() + y.size() - 1;
  const std::size_t n = FastLength(lags);
  // x is shifted so that lag -(n_x - 1) lands on entry 0: no wrap-around into the answer.
  std::vector<double> a(n, 0.0), b(n, 0.0);
  std::copy(x.begin(), x.end(), a.begin());
  std::copy(y.begin(), y.end(), b.begin() + static_cast<std::ptrdiff_t>(x.size()) - 1);
  std::vector<std::complex<double>> A = RealFft(a);
  const std::vector<std::complex<double>> B = RealFft(b);
  for (std::size_t k = 0; k < A.size(); ++k) A[k] = std::conj(A[k]) * B[k];
  std::vector<double> c = InverseRealFft(A, n);
  c.resize(lags);
  return c;
}

}  // namespace unfurl::correlate

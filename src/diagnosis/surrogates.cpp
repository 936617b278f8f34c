// SPDX-License-Identifier: Apache-2.0
#include "surrogates.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <complex>
#include <random>
#include <unsupported/Eigen/FFT>

namespace dynid::detail {
namespace {

// Rows: fewer have no spectrum to speak of, only a sign.
constexpr Eigen::Index shortest = 4;

using Complex = std::complex<double>;

/// Discrete Fourier transforms of one size. Where that has a large prime factor, as a convolution of a size
/// that is a power of two (Bluestein 1970): a plain one would take that many times as long.
class Transform {
 public:
  explicit Transform(Eigen::Index size) : size_(static_cast<std::size_t>(size)) {
    constexpr std::size_t quick = 13;  // prime factors up to it
    std::size_t rest = size_;
    for (std::size_t p = 2; p <= quick; ++p)
      while (rest > 1 && rest % p == 0) rest /= p;
    if (rest <= 1) return;
    std::size_t wide = 1;
    while (wide < 2 * size_) wide *= 2;
    std::vector<Complex> kernel(wide, 0.0);
    chirp_.resize(size_);
    for (std::size_t k = 0; k < size_; ++k) {
      // k^2 pi / n turns whole after 2 n: taken modulo that, it stays exact.
      chirp_[k] = std::polar(1.0, -M_PI * double(k * k % (2 * size_)) / double(size_));
      kernel[k] = std::conj(chirp_[k]);
      if (k > 0) kernel[wide - k] = kernel[k];
    }
    fft_.fwd(kernel_, kernel);
  }

  std::vector<Complex> forward(const std::vector<Complex>& x) {
    std::vector<Complex> out;
    if (chirp_.empty()) {
      fft_.fwd(out, x);
      return out;
    }
    std::vector<Complex> turned(kernel_.size(), 0.0), spectrum;
    for (std::size_t k = 0; k < size_; ++k) turned[k] = x[k] * chirp_[k];
    fft_.fwd(spectrum, turned);
    for (std::size_t k = 0; k < spectrum.size(); ++k) spectrum[k] *= kernel_[k];
    fft_.inv(turned, spectrum);
    out.assign(turned.begin(), turned.begin() + static_cast<std::ptrdiff_t>(size_));
    for (std::size_t k = 0; k < size_; ++k) out[k] *= chirp_[k];
    return out;
  }

  /// Of two spectra of real signals at once: the one is the real part, the other the imaginary part.
  std::vector<Complex> inverse(const std::vector<Complex>& real, const std::vector<Complex>& imaginary) {
    std::vector<Complex> both(size_);
    for (std::size_t k = 0; k < size_; ++k) both[k] = std::conj(real[k] + Complex(0.0, 1.0) * imaginary[k]);
    both = forward(both);
    for (Complex& x : both) x = std::conj(x) / double(size_);
    return both;
  }

 private:
  std::size_t size_;
  std::vector<Complex> chirp_, kernel_;  // empty: the size has small factors
  Eigen::FFT<double> fft_;
};

/// What a surrogate makes of a spectrum: each bin is turned, and the zero bin, which has no phase to turn, is
/// mixed from the lowest ones, as they go together over the joints.
struct Turn {
  std::vector<Complex> phase;
  Eigen::VectorXd mix;
};

class Turns {
 public:
  explicit Turns(std::mt19937_64& random) : random_(random) {}

  Turn draw(Eigen::Index size) {
    const Eigen::Index half = size / 2, lowest = std::min<Eigen::Index>(5, half);
    Turn out{std::vector<Complex>(static_cast<std::size_t>(size), 1.0), Eigen::VectorXd(2 * lowest)};
    for (Eigen::Index k = 1; k <= half; ++k) {
      const Complex phase =
          2 * k == size ? Complex(random_() % 2 == 0 ? 1.0 : -1.0) : std::polar(1.0, angle_(random_));
      out.phase[static_cast<std::size_t>(k)] = phase;
      if (2 * k != size) out.phase[static_cast<std::size_t>(size - k)] = std::conj(phase);
    }
    // Being an estimate from 2 x `lowest` numbers, the distribution of the mean is Student's.
    for (double& m : out.mix) m = normal_(random_);
    out.mix /= std::sqrt(chi_squared_(random_));
    return out;
  }

 private:
  std::mt19937_64& random_;
  std::uniform_real_distribution<double> angle_{-M_PI, M_PI};
  std::normal_distribution<double> normal_;
  std::chi_squared_distribution<double> chi_squared_{10.0};
};

std::vector<Complex> turned(std::vector<Complex> x, const Turn& turn) {
  double mean = 0.0;
  for (Eigen::Index k = 1; k <= turn.mix.size() / 2; ++k) {
    const Complex bin = x[static_cast<std::size_t>(k)];
    mean += std::sqrt(2.0) * (turn.mix[2 * k - 2] * bin.real() + turn.mix[2 * k - 1] * bin.imag());
  }
  x[0] = mean;
  for (std::size_t k = 1; k < x.size(); ++k) x[k] *= turn.phase[k];
  return x;
}

}  // namespace

std::vector<Eigen::MatrixXd> surrogates(const GapRows& rows, const Eigen::MatrixXd& gap, int count,
                                        unsigned seed) {
  std::mt19937_64 random(seed);
  Turns turning(random);
  std::vector<Eigen::MatrixXd> out(static_cast<std::size_t>(count), Eigen::MatrixXd(gap.rows(), gap.cols()));
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index first = rows.parts[p], size = rows.parts[p + 1] - first;
    if (size < shortest) {
      for (Eigen::MatrixXd& surrogate : out)
        surrogate.middleRows(first, size) = (random() % 2 == 0 ? 1.0 : -1.0) * gap.middleRows(first, size);
      continue;
    }
    const Transform transform(size);
    std::vector<std::vector<Complex>> spectra;
    Transform forth = transform;
    for (Eigen::Index j = 0; j < gap.cols(); ++j) {
      const Eigen::VectorXcd x = gap.col(j).segment(first, size).cast<Complex>();
      spectra.push_back(forth.forward({x.data(), x.data() + size}));
    }
    std::vector<Turn> turns;
    for (int k = 0; k < count; ++k) turns.push_back(turning.draw(size));
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, out.size()), [&](const auto& some) {
      Transform back = transform;
      for (std::size_t k = some.begin(); k < some.end(); ++k) {
        for (std::size_t j = 0; j < spectra.size(); j += 2) {
          const bool pair = j + 1 < spectra.size();
          const std::vector<Complex> x =
              back.inverse(turned(spectra[j], turns[k]), pair ? turned(spectra[j + 1], turns[k])
                                                              : std::vector<Complex>(spectra[j].size(), 0.0));
          const auto values = Eigen::Map<const Eigen::VectorXcd>(x.data(), size);
          const auto column = static_cast<Eigen::Index>(j);
          out[k].col(column).segment(first, size) = values.real();
          if (pair) out[k].col(column + 1).segment(first, size) = values.imag();
        }
      }
    });
  }
  return out;
}

}  // namespace dynid::detail

// SPDX-License-Identifier: Apache-2.0
#include "surrogates.hpp"

#include <cmath>
#include <complex>
#include <random>
#include <unsupported/Eigen/FFT>

namespace dynid::detail {
namespace {

// Rows: fewer have no spectrum to speak of, only a sign.
constexpr Eigen::Index shortest = 4;

}  // namespace

std::vector<Eigen::MatrixXd> surrogates(const GapRows& rows, const Eigen::MatrixXd& gap, int count,
                                        unsigned seed) {
  using Complex = std::complex<double>;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> angle(-M_PI, M_PI);
  std::normal_distribution<double> normal;
  std::chi_squared_distribution<double> chi_squared(10.0);
  std::vector<Eigen::MatrixXd> out(static_cast<std::size_t>(count), Eigen::MatrixXd(gap.rows(), gap.cols()));
  Eigen::FFT<double> fft;
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index first = rows.parts[p], size = rows.parts[p + 1] - first;
    if (size < shortest) {
      for (Eigen::MatrixXd& surrogate : out)
        surrogate.middleRows(first, size) = (random() % 2 == 0 ? 1.0 : -1.0) * gap.middleRows(first, size);
      continue;
    }
    std::vector<std::vector<Complex>> spectra(static_cast<std::size_t>(gap.cols()));
    for (Eigen::Index j = 0; j < gap.cols(); ++j) {
      const Eigen::VectorXd x = gap.col(j).segment(first, size);
      fft.fwd(spectra[static_cast<std::size_t>(j)], std::vector<double>(x.data(), x.data() + size));
    }
    const Eigen::Index half = size / 2;
    for (Eigen::MatrixXd& surrogate : out) {
      std::vector<Complex> turn(static_cast<std::size_t>(size), 1.0);
      for (Eigen::Index k = 1; k <= half; ++k) {
        const Complex phase =
            2 * k == size ? Complex(random() % 2 == 0 ? 1.0 : -1.0) : std::polar(1.0, angle(random));
        turn[static_cast<std::size_t>(k)] = phase;
        if (2 * k != size) turn[static_cast<std::size_t>(size - k)] = std::conj(phase);
      }
      // The zero bin has no phase to turn. Its amplitude is drawn from the lowest bins, as they go together
      // over the joints; being an estimate from 2 x `lowest` numbers, its distribution is Student's.
      const Eigen::Index lowest = std::min<Eigen::Index>(5, half);
      Eigen::VectorXd mix(2 * lowest);
      for (double& m : mix) m = normal(random);
      mix /= std::sqrt(chi_squared(random));
      for (Eigen::Index j = 0; j < gap.cols(); ++j) {
        std::vector<Complex> turned = spectra[static_cast<std::size_t>(j)];
        double mean = 0.0;
        for (Eigen::Index k = 1; k <= lowest; ++k) {
          const Complex bin = turned[static_cast<std::size_t>(k)];
          mean += std::sqrt(2.0) * (mix[2 * k - 2] * bin.real() + mix[2 * k - 1] * bin.imag());
        }
        turned[0] = mean;
        for (std::size_t k = 1; k < turned.size(); ++k) turned[k] *= turn[k];
        std::vector<double> x;
        fft.inv(x, turned);
        surrogate.col(j).segment(first, size) = Eigen::Map<Eigen::VectorXd>(x.data(), size);
      }
    }
  }
  return out;
}

}  // namespace dynid::detail

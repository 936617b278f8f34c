// SPDX-License-Identifier: Apache-2.0
#include "surrogates.hpp"

#include <cmath>
#include <complex>
#include <random>
#include <unsupported/Eigen/FFT>

namespace dynid::detail {

std::vector<Eigen::MatrixXd> surrogates(const GapRows& rows, const Eigen::MatrixXd& gap, int count,
                                        unsigned seed) {
  using Complex = std::complex<double>;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> angle(-M_PI, M_PI);
  std::normal_distribution<double> normal;
  std::vector<Eigen::MatrixXd> out(static_cast<std::size_t>(count), Eigen::MatrixXd(gap.rows(), gap.cols()));
  Eigen::FFT<double> fft;
  for (std::size_t p = 0; p + 1 < rows.parts.size(); ++p) {
    const Eigen::Index first = rows.parts[p], size = rows.parts[p + 1] - first;
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
      const double mean = normal(random);
      for (Eigen::Index j = 0; j < gap.cols(); ++j) {
        std::vector<Complex> turned = spectra[static_cast<std::size_t>(j)];
        double low = 0.0;
        const Eigen::Index lowest = std::min<Eigen::Index>(3, half);
        for (Eigen::Index k = 1; k <= lowest; ++k)
          low += std::norm(turned[static_cast<std::size_t>(k)]) / double(lowest);
        turned[0] = mean * std::sqrt(low);
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

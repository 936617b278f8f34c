// SPDX-License-Identifier: Apache-2.0
#include "dynid/signal/spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>
#include <unsupported/Eigen/FFT>
#include <vector>

#include "dynid/base/error.hpp"

namespace dynid {

Spectrum welch(const Eigen::Ref<const Eigen::VectorXd>& x, double rate, double window) {
  if (x.size() < 8) throw Error("a spectrum needs at least 8 samples, found " + std::to_string(x.size()));
  // An even length of small prime factors keeps the transform quick.
  Eigen::Index size = 8;
  while (2 * size <= std::min<Eigen::Index>(x.size(), static_cast<Eigen::Index>(window * rate))) size *= 2;
  const Eigen::ArrayXd phase =
      Eigen::ArrayXd::LinSpaced(size, 0.0, 2.0 * M_PI * double(size - 1) / double(size));
  const Eigen::VectorXd hann = (0.5 - 0.5 * phase.cos()).matrix();

  const Eigen::Index bins = size / 2 + 1;
  Spectrum s;
  s.frequency = Eigen::VectorXd::LinSpaced(bins, 0.0, 0.5 * rate);
  s.density = Eigen::VectorXd::Zero(bins);
  Eigen::FFT<double> fft;
  std::vector<double> block(static_cast<std::size_t>(size));
  std::vector<std::complex<double>> bin;
  int blocks = 0;
  for (Eigen::Index start = 0; start + size <= x.size(); start += size / 2, ++blocks) {
    const auto part = x.segment(start, size);
    Eigen::Map<Eigen::VectorXd>(block.data(), size) =
        (part.array() - part.mean()).matrix().cwiseProduct(hann);
    fft.fwd(bin, block);
    for (Eigen::Index k = 0; k < bins; ++k) s.density[k] += std::norm(bin[static_cast<std::size_t>(k)]);
  }
  s.density *= 2.0 / (rate * hann.squaredNorm() * blocks);
  s.density[0] *= 0.5;
  s.density[bins - 1] *= 0.5;
  return s;
}

}  // namespace dynid

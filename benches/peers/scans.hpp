// The scans that scans.py wrote, and the clock that the peers in C++ are held by. Metres, milliseconds.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace peers {

struct Point {
  float x, y, z;
};

struct Scan {
  std::array<double, 12> fixed_from_optical;  // rows of a 3x4 matrix
  std::vector<Point> points;                  // the valid ones, in the optical frame

  Point in_fixed_frame(const Point& p) const {
    const auto& m = fixed_from_optical;
    const auto row = [&](int i) {
      return static_cast<float>(m[i] * p.x + m[i + 1] * p.y + m[i + 2] * p.z + m[i + 3]);
    };
    return {row(0), row(4), row(8)};
  }

  Point sensor() const { return in_fixed_frame({0, 0, 0}); }
};

// Throws where the file ends early. `step`: every step-th scan is kept.
inline std::vector<Scan> read_scans(const std::string& path, std::uint32_t step) {
  std::ifstream file(path, std::ios::binary);
  file.exceptions(std::ios::failbit | std::ios::badbit);
  const auto read = [&](void* to, std::size_t bytes) { file.read(static_cast<char*>(to), bytes); };
  std::uint32_t sizes[3];
  read(sizes, sizeof sizes);
  std::vector<Point> grid(std::size_t{sizes[1]} * sizes[2]);
  std::vector<Scan> scans;
  for (std::uint32_t i = 0; i < sizes[0]; ++i) {
    Scan scan;
    read(scan.fixed_from_optical.data(), sizeof scan.fixed_from_optical);
    read(grid.data(), grid.size() * sizeof(Point));
    if (i % step != 0) continue;
    std::copy_if(grid.begin(), grid.end(), std::back_inserter(scan.points),
                 [](const Point& p) { return !std::isnan(p.z); });
    scans.push_back(std::move(scan));
  }
  return scans;
}

template <class Work>
double milliseconds(Work&& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

inline double median(std::vector<double> values) {
  if (values.empty()) throw std::invalid_argument("no scans");
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace peers

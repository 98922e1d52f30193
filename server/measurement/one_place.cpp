#include "server/measurement/one_place.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace trammel {

double spread_of(const Eigen::Matrix3Xd& points) {
  return (points.colwise() - points.rowwise().mean()).norm() /
         std::sqrt(static_cast<double>(points.cols()));
}

bool are_at_one_place(const Eigen::Matrix3Xd& points) {
  constexpr double kOnePlace = 50e-3;
  return points.cols() > 0 && spread_of(points) < kOnePlace;
}

bool is_each_tool_at_one_place(const MeasurementBatch& batch) {
  std::map<std::string, std::vector<Vector3>> points;
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge) points[m.context.tool].push_back(m.p_W);
  }
  return !points.empty() && std::all_of(points.begin(), points.end(), [](const auto& tool) {
    const auto count = static_cast<Eigen::Index>(tool.second.size());
    return are_at_one_place(
        Eigen::Map<const Eigen::Matrix3Xd>(tool.second.front().data(), 3, count));
  });
}

}  // namespace trammel

#include "server/calibrate/sessions/session_setting.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

constexpr double kSamePlace = 1e-4;    // m: two positions nearer to each other are one
constexpr double kLeastBeside = 1e-3;  // m rms beside the best line

}  // namespace

Similarity Similarity::operator*(const Similarity& first) const {
  return {make_pose(X.linear() * first.X.linear(), *this * first.X.translation()),
          (1 + scale) * (1 + first.scale) - 1};
}

bool operator==(const SessionSetting& a, const SessionSetting& b) {
  return a.id == b.id && a.first == b.first && a.first_pose == b.first_pose && a.poses == b.poses &&
         a.X_WS.matrix() == b.X_WS.matrix() && a.scale == b.scale && a.own_noise == b.own_noise &&
         a.own_noise_rotation == b.own_noise_rotation;
}

bool are_stretched(const std::vector<SessionSetting>& settings) {
  return std::any_of(settings.begin(), settings.end(),
                     [](const SessionSetting& setting) { return setting.scale != 0; });
}

std::vector<SessionSetting> settings_of(const MeasurementBatch& batch) {
  std::vector<SessionSetting> settings(batch.sessions.size());
  if (settings.empty()) return settings;
  for (std::size_t s = 0; s < settings.size(); ++s) settings[s].id = batch.sessions[s];
  for (const Measurement& m : batch.measurements) {
    SessionSetting& setting = settings[static_cast<std::size_t>(m.session)];
    if (setting.poses == 0 || m.context.index < setting.first) {
      setting.first = m.context.index;
      setting.first_pose = m.pose_id;
    }
    ++setting.poses;
  }
  return settings;
}

MeasurementBatch moved(MeasurementBatch batch, const std::vector<SessionSetting>& settings,
                       double sigma, double sigma_rotation) {
  for (Measurement& m : batch.measurements) {
    const SessionSetting& setting = settings[static_cast<std::size_t>(m.session)];
    m.p_W = setting.into_W() * m.p_W;
    if (m.R_WT) m.R_WT = (setting.X_WS.linear() * *m.R_WT).eval();
    if (setting.own_noise > 0) m.sigma = std::hypot(m.sigma.value_or(sigma), setting.own_noise);
    if (setting.own_noise_rotation > 0)
      m.sigma_rotation =
          std::hypot(m.sigma_rotation.value_or(sigma_rotation), setting.own_noise_rotation);
  }
  return batch;
}

MeasurementBatch aligned(MeasurementBatch batch, const std::vector<SessionSetting>& settings,
                         const Tracker& tracker) {
  if (settings.empty()) return batch;
  batch = moved(std::move(batch), settings, tracker.sigma, tracker.sigma_rotation);
  batch.sessions.clear();
  return batch;
}

std::string why_not_placed(const MeasurementBatch& session) {
  const auto n = static_cast<Eigen::Index>(session.measurements.size());
  std::vector<Vector3> places;  // the first that differ
  Eigen::Matrix3Xd p(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = session.measurements[static_cast<std::size_t>(i)];
    if (m.R_WT) return "";
    p.col(i) = m.p_W;
    const bool known = std::any_of(places.begin(), places.end(), [&](const Vector3& place) {
      return (place - m.p_W).norm() < kSamePlace;
    });
    if (!known && places.size() < 3) places.push_back(m.p_W);
  }
  if (places.size() < 3)
    return fmt::format("{} positions do not tell where its instrument stood, at least 3 are needed",
                       places.size());
  const Eigen::Matrix3Xd from_mean = p.colwise() - p.rowwise().mean();
  const Vector3 spread = Eigen::JacobiSVD<Eigen::Matrix3Xd>(from_mean).singularValues() /
                         std::sqrt(static_cast<double>(n));
  if (spread(1) > kLeastBeside) return "";
  return fmt::format(
      "its positions lie on one line within {:.2f} mm, limit {:g} mm: they do not tell where its "
      "instrument stood",
      to_mm(spread(1)), to_mm(kLeastBeside));
}

}  // namespace trammel

#include "server/measurement/files/references.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

constexpr Eigen::Index kLeastReflectors = 3;

const NamedPoint* find_point(const PointList& list, const std::string& name) {
  const auto at = std::find_if(list.points.begin(), list.points.end(),
                               [&](const NamedPoint& p) { return p.name == name; });
  return at == list.points.end() ? nullptr : &*at;
}

double rms(const Eigen::Matrix3Xd& vectors) {
  return std::sqrt(vectors.squaredNorm() / static_cast<double>(vectors.cols()));
}

Status check_names(const PointList& references, const PointList& measured) {
  for (const NamedPoint& point : measured.points) {
    if (find_point(references, point.name) != nullptr) continue;
    return refused("reflector '{}' is none of the references in {}", point.name, references.where)
        .in(measured.where)
        .at_row(point.row)
        .of("name")
        .with_text(point.name);
  }
  return {};
}

}  // namespace

Result<ReferenceCheck> check_references(const PointList& references, const PointList& measured,
                                        const ReferenceOptions& options) {
  if (!(options.localise_above > 0) || !(options.repeat_above >= options.localise_above)) {
    return refused("references: limits {:g} mm and {:g} mm, expected 0 < localise <= repeat",
                   to_mm(options.localise_above), to_mm(options.repeat_above))
        .beyond(to_mm(options.localise_above), to_mm(options.repeat_above));
  }
  TRY(check_names(references, measured));
  ReferenceCheck check;
  Eigen::Matrix3Xd p_W(3, static_cast<Eigen::Index>(references.points.size()));
  Eigen::Matrix3Xd p_V = p_W;
  Eigen::Index count = 0;
  for (const NamedPoint& reference : references.points) {
    const NamedPoint* now = find_point(measured, reference.name);
    if (now == nullptr) {
      check.not_measured.push_back(reference.name);
      continue;
    }
    p_W.col(count) = reference.p_W;
    p_V.col(count) = now->p_W;
    check.residuals.push_back({reference.name, now->p_W - reference.p_W, Vector3::Zero()});
    ++count;
  }
  if (count < kLeastReflectors) {
    return refused("{} of the reference reflectors in {}, at least {} are needed", count,
                   references.where, kLeastReflectors)
        .in(measured.where)
        .beyond(count, kLeastReflectors);
  }
  p_W.conservativeResize(3, count);
  p_V.conservativeResize(3, count);
  const Result<Pose> X_WV = fit_transform(p_W, p_V);
  if (!X_WV) return Failure(X_WV.error()).as(ErrorCode::kRefused).in(measured.where);
  check.X_WV = *X_WV;
  const Eigen::Matrix3Xd remaining = ((X_WV->linear() * p_V).colwise() + X_WV->translation()) - p_W;
  Eigen::Index worst = 0;
  remaining.colwise().norm().maxCoeff(&worst);
  for (Eigen::Index i = 0; i < count; ++i)
    check.residuals[static_cast<std::size_t>(i)].remaining_W = remaining.col(i);
  check.worst = check.residuals[static_cast<std::size_t>(worst)].name;
  check.rms = rms(p_V - p_W);
  check.rms_remaining = rms(remaining);
  check.rigid = check.rms_remaining <= options.repeat_above;
  check.verdict = check.rms <= options.localise_above ? ReferenceVerdict::kFine
                  : check.rms <= options.repeat_above ? ReferenceVerdict::kLocalise
                                                      : ReferenceVerdict::kLocaliseAndRepeat;
  return check;
}

MeasurementBatch localised(MeasurementBatch batch, const Pose& X_WV) {
  for (Measurement& m : batch.measurements) {
    m.p_W = X_WV * m.p_W;
    if (m.R_WT) m.R_WT = X_WV.linear() * *m.R_WT;
  }
  batch.source_text = to_csv(batch);
  return batch;
}

}  // namespace trammel

#include "server/error_sources/anchors.h"

#include <algorithm>
#include <map>

#include "server/base/check.h"
#include "server/error_sources/parameter.h"

namespace trammel {

namespace {

constexpr double kTypical = 2;  // mm, as of a base; where one is unknown its prior is widened as that of a base is

const CauseRecord& record() {
  static const CauseRecord of_instruments = {
      .spelling = kAnchors,
      .plain_name = "anchors of the instruments",
      .plain_name_of_joint = "",
      .scope = causes::Scope::kSession,
      .lasting = causes::Lasting::kAlways,
      .needs = {},
      .search = causes::SearchFamily::kNone,
      .acts = {causes::ActsOn::kBase, 9},
      .forms = {},
      .rivals = {},
      .told_apart_by = causes::remedies::kFixedBase,
      .shown_by = "distances to anchors, or touches of them",
      .action = "give the anchor's xyz_mm and zero_mm in the cell file",
      .figures = {},
  };
  return of_instruments;
}

/// One of the two lists.
class Instruments final : public ErrorSource {
 public:
  Instruments(std::string name, Anchors anchors) : name_(std::move(name)), anchors_(std::move(anchors)) {
    for (const auto& [id, anchor] : anchors_) {
      if (name_ == kAnchors ? anchor.p_W.has_value() : anchor.zero.has_value()) continue;
      first_[id] = static_cast<Eigen::Index>(parameters_.size());
      if (name_ == kAnchors) {
        for (const char* axis : {"ax", "ay", "az"})
          parameters_.push_back(length_parameter(fmt::format("{}[{}]", axis, id), kTypical));
      } else {
        parameters_.push_back(length_parameter(fmt::format("zero[{}]", id), kTypical));
      }
    }
  }
  const CauseRecord& cause() const override { return record(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return name_ == kAnchors ? "anchors of the instruments are where the measurements put them"
                             : "an instrument tells every distance too long by the same amount";
  }
  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>&, ArmState&, StateJacobian*,
             int) const override {}

  [[nodiscard]] const Anchors& anchors() const { return anchors_; }
  /// Place of its first parameter, from `first` on; -1: it has none.
  [[nodiscard]] Eigen::Index place(const std::string& id, Eigen::Index first) const {
    const auto found = first_.find(id);
    return found == first_.end() ? -1 : first + found->second;
  }

 private:
  std::string name_;
  Anchors anchors_;
  std::map<std::string, Eigen::Index> first_;
  std::vector<Parameter> parameters_;
};

/// h(q), with its derivative added to `jacobian`, `sign` times.
double told_at(const PhysicalModel& model, const PoseContext& context, const Gauge& gauge, const PlacedAnchor& anchor,
               const Eigen::VectorXd& values, double sign, Eigen::RowVectorXd* jacobian) {
  Eigen::MatrixXd J;
  const Pose X_WT = model.pose_W(context, values, jacobian != nullptr ? &J : nullptr);
  const GaugedLength length = gauged_length(gauge.kind, *anchor.said, anchor.p_W(values), X_WT.translation());
  if (jacobian != nullptr) {
    *jacobian += sign * (length.by_point_W.transpose() * J.topRows<3>());
    if (anchor.place >= 0) jacobian->segment<3>(anchor.place) -= sign * length.by_point_W.transpose();
    if (anchor.zero >= 0) (*jacobian)(anchor.zero) += sign;
  }
  return length.value + anchor.zero_at(values);
}

}  // namespace

bool is_of_instruments(std::string_view spec) { return spec == kAnchors || spec == kInstrumentZero; }

bool is_of_instruments(const ErrorSource& source) { return &source.cause() == &record(); }

Result<ErrorSourcePtr> make_instrument_source(const std::string& spec, const Cell& cell) {
  if (!is_of_instruments(spec)) return failure(ErrorCode::kUsage, "'{}' is nothing of instruments", spec);
  return anchors_of(cell).map(
      [&](Anchors anchors) -> ErrorSourcePtr { return std::make_shared<Instruments>(spec, std::move(anchors)); });
}

Vector3 PlacedAnchor::p_W(const Eigen::VectorXd& values) const {
  return place >= 0 ? Vector3(values.segment<3>(place)) : said->p_W.value_or(Vector3::Zero());
}

double PlacedAnchor::zero_at(const Eigen::VectorXd& values) const {
  return zero >= 0 ? values(zero) : said->zero.value_or(0);
}

PlacedAnchor placed_anchor(const PhysicalModel& model, const std::string& id) {
  PlacedAnchor placed;
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    if (const auto* instruments = dynamic_cast<const Instruments*>(source.get())) {
      const auto said = instruments->anchors().find(id);
      if (said != instruments->anchors().end() && instruments->name() == kAnchors) placed.said = &said->second;
      (instruments->name() == kAnchors ? placed.place : placed.zero) = instruments->place(id, first);
    }
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  return placed;
}

double predicted_gauge(const PhysicalModel& model, const PoseContext& context, const Gauge& gauge,
                       const Eigen::VectorXd& values, Eigen::RowVectorXd* jacobian) {
  const PlacedAnchor anchor = placed_anchor(model, gauge.anchor);
  TRAMMEL_CHECK(anchor.said != nullptr);
  if (jacobian != nullptr) jacobian->setZero(values.size());
  double told = told_at(model, context, gauge, anchor, values, 1, jacobian);
  if (gauge.minus != nullptr) told -= told_at(model, *gauge.minus, gauge, anchor, values, -1, jacobian);
  return told;
}

}  // namespace trammel

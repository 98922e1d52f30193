#include "server/error_sources/instruments.h"

#include "server/error_sources/parameter.h"

namespace trammel {

namespace {

constexpr double kTypical =
    2;  // mm, as for a base; the prior of an unknown one is widened as that of a base is
constexpr double kTypicalTilt = 1e-3;  // rad, likewise

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

}  // namespace

Instruments::Instruments(std::string name, Anchors anchors)
    : name_(std::move(name)), anchors_(std::move(anchors)) {
  for (const auto& [id, anchor] : anchors_) {
    const bool is_open_plane = anchor.shape == Anchor::Shape::kPlane && !anchor.p_W;
    if (name_ == kAnchors ? anchor.p_W.has_value() : anchor.zero.has_value() || is_open_plane)
      continue;
    first_[id] = static_cast<Eigen::Index>(parameters_.size());
    if (name_ == kAnchors && is_open_plane) {
      parameters_.push_back(length_parameter(fmt::format("offset[{}]", id), kTypical));
      for (const char* tilt : {"tilt1", "tilt2"})
        parameters_.push_back(angle_parameter(fmt::format("{}[{}]", tilt, id), kTypicalTilt));
    } else if (name_ == kAnchors) {
      for (const char* axis : {"ax", "ay", "az"})
        parameters_.push_back(length_parameter(fmt::format("{}[{}]", axis, id), kTypical));
    } else {
      parameters_.push_back(length_parameter(fmt::format("zero[{}]", id), kTypical));
    }
  }
}

const CauseRecord& Instruments::cause() const { return record(); }

std::string Instruments::explanation() const {
  return name_ == kAnchors ? "anchors of the instruments are where the measurements put them"
                           : "an instrument tells every distance too long by the same amount";
}

Eigen::Index Instruments::place(const std::string& id, Eigen::Index first) const {
  const auto found = first_.find(id);
  return found == first_.end() ? -1 : first + found->second;
}

bool is_of_instruments(std::string_view spec) {
  return spec == kAnchors || spec == kInstrumentZero;
}

bool is_of_instruments(const ErrorSource& source) { return &source.cause() == &record(); }

Result<ErrorSourcePtr> make_instrument_source(const std::string& spec, const Cell& cell) {
  if (!is_of_instruments(spec))
    return failure(ErrorCode::kUsage, "'{}' is nothing of instruments", spec);
  return anchors_of(cell).map([&](Anchors anchors) -> ErrorSourcePtr {
    return std::make_shared<Instruments>(spec, std::move(anchors));
  });
}

}  // namespace trammel

#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/error_sources/error_source.h"
#include "server/robot/gauge.h"

/// The parameters of instruments with one number per reading, as sources of a model.
namespace trammel {

inline constexpr std::string_view kAnchors = "anchors";
inline constexpr std::string_view kInstrumentZero = "instrument_zero";

[[nodiscard]] bool is_of_instruments(std::string_view spec);
[[nodiscard]] bool is_of_instruments(const ErrorSource& source);

/// Makes one of two sources. `anchors` has `ax[ID]`, `ay[ID]`, `az[ID]` (m in W) for each anchor
/// whose place the cell file leaves open; they are 0 until they are identified. A plane of unknown
/// place has `offset[ID]` (m) and `tilt1[ID]`, `tilt2[ID]` (rad, tilted_normal()) in their stead.
/// `instrument_zero` has `zero[ID]` (m) for each instrument whose zero the file leaves open; that
/// of a plane of unknown place is a part of its offset. Refuses any other spelling.
[[nodiscard]] Result<ErrorSourcePtr> make_instrument_source(const std::string& spec,
                                                            const Cell& cell);

/// One of the two lists.
class Instruments final : public ErrorSource {
 public:
  Instruments(std::string name, Anchors anchors);
  const CauseRecord& cause() const override;
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override;
  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>&, ArmState&,
             StateJacobian*, int) const override {}

  [[nodiscard]] const Anchors& anchors() const { return anchors_; }
  /// Place of its first parameter, from `first` on; -1: it has none.
  [[nodiscard]] Eigen::Index place(const std::string& id, Eigen::Index first) const;

 private:
  std::string name_;
  Anchors anchors_;
  std::map<std::string, Eigen::Index> first_;
  std::vector<Parameter> parameters_;
};

}  // namespace trammel

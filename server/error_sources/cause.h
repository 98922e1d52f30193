#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/result.h"

/// The description of a physical cause of error: all that calibration, diagnosis, planning,
/// training and the pages need, except its effect on the arm. Each record stands beside its
/// physics, in the file of the cause.
namespace trammel {

class ErrorSource;
struct Cell;

/// The columns that each pose needs for a cause to show.
struct ContextNeeds {
  bool time = false;
  bool temperature = false;
  bool direction = false;  ///< of the source's joint, approached from both sides
  bool velocity = false;
  bool payload = false;  ///< something must hang on the flange
  bool before = false;   ///< the previous pose of the robot
  bool history = false;  ///< temperature and time of every pose
  bool stand = false;    ///< the place of the instrument, in the cell file
};

/// `gear_transmission:3@48.5+97`: a cause, its joint, and further numbers.
struct SourceSpec {
  std::string text;        ///< as spelled
  std::string name;        ///< the cause, or its form
  int joint = -1;          ///< 0-based; -1 where none is named
  std::vector<double> at;  ///< after the @: orders, or the first pose (1-based row of the batch)
};
using SourceMaker = Result<std::shared_ptr<const ErrorSource>> (*)(const SourceSpec& spec,
                                                                   const Cell& cell);

/// The members of a record.
namespace causes {

/// The part of the cell that the cause belongs to.
enum class Scope {
  kArm,    ///< of the whole arm
  kJoint,  ///< the cause acts on one joint, or on the link behind it: its spelling ends in `:joint`
  kCell,   ///< of the rest of the cell file: base, tools and payloads
  kPose,   ///< of single poses
  kSession,  ///< of the measurement: position and clock of the instrument
};

/// The duration of the cause.
enum class Lasting {
  kAlways,        ///< belongs into the cell file
  kFromAPose,     ///< begins at a pose of a batch: its spelling ends in `@row`
  kOfTheSession,  ///< the cause acts on one batch, and on all of it
};

/// Which part of the nominal cell its parameters correct.
enum class Part { kNone, kBase, kLinks, kTool, kPayload };

/// The way in which diagnosis searches for the cause.
enum class SearchFamily {
  kNone,      ///< not at all
  kColumns,   ///< its parameters, all at once
  kPlay,      ///< the same, and its parameter has only one possible sign
  kStep,      ///< its parameters from a pose on, at every pose
  kZeroStep,  ///< the same of a joint's own zero
  kOrder,     ///< a sine and a cosine of a joint's angle, at every order
  kMap,       ///< any periodic function of a joint's angle
  kPose,      ///< every pose by itself
};

/// The kind of thing that a record describes.
enum class StandsFor {
  kACause,           ///< one physical cause
  kNoKnownCause,     ///< an effect that no known cause explains
  kArmNotAsModelled  ///< any number of the arm's causes together: the arm differs from the model in
                     ///< force
};

/// Tells whether a cause may be wrong in single parameters.
enum class Numbers {
  kTogether,   ///< all parameters together
  kSingly,     ///< one by one, and each is this same cause
  kApart,      ///< one by one, and two of them count as two causes
  kOneAJoint,  ///< the same, and each is a joint's
};

/// The summary that reports print before the parameters.
enum class Summary { kNone, kOrderAndAmplitude, kAmplitude, kPeakToPeak };

/// The way in which another cause resembles this one.
enum class Likeness {
  kFromTheFirstPose,  ///< the other is this one, begun before the first pose
  kSpecialCase,       ///< the other is a special case of this cause
  kSimplerCase,       ///< a special case; preferred if it explains nearly as much
  kDoubtfulCase,      ///< a special case; if neither is clearly better, neither is certain
  kWhereConstant,     ///< the effects are equal if the quantity on which this cause depends never
                      ///< changes
  kImitator,          ///< an unrelated cause that looks like this one at some poses
};
struct Rival {
  std::string_view cause;
  Likeness likeness = Likeness::kImitator;
  std::string_view parameter =
      {};               ///< one of its parameters, `{}` for the joint; empty: the whole cause
  double surprise = 0;  ///< nat: penalty on this cause while the model lacks a source of the rival
};

/// The measurement that distinguishes a cause from its rivals. Of the remedies of two causes,
/// messages name the one with the lower rank.
struct Remedy {
  int rank = 0;
  std::string_view text;
};
/// Remedies that several causes share.
namespace remedies {
inline constexpr Remedy kBothSides{10, "approaching every pose from both sides (--bidirectional)"};
inline constexpr Remedy kOtherLoad{20, "a second known payload, or a run without any"};
inline constexpr Remedy kOtherTemperature{30, "a second temperature, recorded with every pose"};
inline constexpr Remedy kReflectors{40, "reference reflectors, and the time of every pose"};
inline constexpr Remedy kOtherSpeed{50, "other speeds, and the time of every pose"};
inline constexpr Remedy kOtherTool{60, "a second tool"};
inline constexpr Remedy kFixedBase{70, "reference reflectors that fix where the base stands"};
inline constexpr Remedy kWiderRange{80, "a wider range of joints, or another tool"};
}  // namespace remedies

/// A number that is reported with a cause.
struct Figure {
  std::string_view name;  ///< beginning of its name
  std::string_view unit;  ///< in people's units; may be empty
  std::string_view meaning;
};

/// The report if a step happened before the first pose of a new batch.
struct WholeBatch {
  std::string_view sentence;  ///< for people; `{}` for the joint
  bool harmful = false;  ///< true: a model must not learn from such a batch, since it would learn
                         ///< an error of the measurement
};

/// Marks a cause whose effect is shown as an example.
struct Example {
  int rank = 0;    ///< the lower, the sooner
  int joint = -1;  ///< 0-based; -1: any
};

/// Marks a cause that training adds by itself, beside another one, if the measurements become much
/// more likely.
struct AddedByData {
  std::string_view beside;  ///< the cause that shows it; it must be among the error sources
  bool (*is_known)(const Cell& cell);  ///< true if the cell's files state the effect; then the
                                       ///< cause is not added
  std::string_view note;               ///< for people, if a model has it
};

/// The order in which causes act on the arm: in the order given here, then by `turn`, then in the
/// order of registration.
enum class ActsOn { kNothing, kBase, kLinks, kTool, kJoints, kLoad, kLoadedArm };
struct Acting {
  ActsOn on = ActsOn::kNothing;
  int turn = 0;
};

/// A way to compute a cause. Most causes have one form, with the spelling of the cause.
struct Form {
  std::string_view spelling;
  SourceMaker make;
};

}  // namespace causes

struct CauseRecord {
  std::string_view spelling;             ///< in files and programs: `gear_transmission`
  std::string_view plain_name;           ///< for people: `gear ripple`
  std::string_view plain_name_of_joint;  ///< the same for one joint: `gear ripple in joint {}`;
                                         ///< empty if it has no joint
  causes::Scope scope;
  causes::Lasting lasting;
  ContextNeeds needs;
  causes::SearchFamily search;
  causes::Acting acts;
  std::vector<causes::Form> forms;  ///< the usual one first; empty: no error source describes it
  std::vector<causes::Rival> rivals;
  causes::Remedy told_apart_by;
  std::string_view shown_by;  ///< the quantity that a batch must record to show the cause
  std::string_view action;    ///< for the shop floor
  std::vector<causes::Figure>
      figures;  ///< figures of its findings: those of the summary, then its parameters

  // Members that only some causes set.
  causes::Part part = causes::Part::kNone;
  causes::Numbers numbers = causes::Numbers::kTogether;
  causes::Summary summary = causes::Summary::kNone;
  bool takes_numbers = false;     ///< its spelling may end in `@number+number`
  bool of_turning_joint = false;  ///< of revolute joints only
  bool gives_way = false;         ///< deforms under load: an error of the payload shows through it
  bool goes_with_time = false;    ///< looks like other effects that grow with time
  std::optional<double> order = {};  ///< cycles per joint turn, if always the same
  std::optional<causes::WholeBatch> whole_batch = {};
  std::optional<causes::Example> example = {};
  /// True if the forms give different results in a cell. If not, only the usual one is used.
  bool (*forms_differ)(const Cell& cell) = nullptr;
  causes::StandsFor stands_for = causes::StandsFor::kACause;
  std::optional<causes::AddedByData> added_by_data = {};
};

/// The rival that a step equals if it began before the first pose; null if the cause does not begin
/// at a pose.
[[nodiscard]] const causes::Rival* whole_of(const CauseRecord& record);

/// The parameter that a rival of a cause of `joint` (0-based) means: `q3`.
[[nodiscard]] std::string parameter_of(const causes::Rival& rival, int joint);

/// `gear ripple in joint 3`, or `gear ripple` without a joint (0-based; -1).
[[nodiscard]] std::string plain_name(const CauseRecord& record, int joint = -1);

}  // namespace trammel

#include "server/plan/measuring_program.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <vector>

#include "server/base/letters.h"
#include "server/base/units.h"

namespace trammel {

namespace {

// Limits of the controllers.
constexpr std::size_t kRapidName = 32;   // letters of a RAPID identifier
constexpr std::size_t kKrlName = 24;     // letters of the name of a KRL program
constexpr int kKrlTools = 16;            // tools in $TOOL_DATA
constexpr std::size_t kLineLength = 80;  // of a RAPID line
constexpr std::size_t kFanucName = 36;   // letters of the name of a TP program
constexpr std::size_t kFanucRemark = 32;
constexpr int kFanucTools = 29;

bool is_name(const std::string& text, std::size_t longest) {
  const auto allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  return !text.empty() && text.size() <= longest &&
         std::isalpha(static_cast<unsigned char>(text[0])) != 0 &&
         std::all_of(text.begin(), text.end(), allowed);
}

/// The name with a prefix, so that it collides with no reserved word and no name inside.
std::string module_name(const std::string& name) {
  std::string text = "T_" + name;
  for (char& c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return text.substr(0, kRapidName);
}

/// Text for a comment: one line of plain letters, within the length that controllers accept.
std::string comment(const std::string& sign, std::string text) {
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '_';
  }
  return (sign + " " + text).substr(0, kLineLength - 4);
}

/// What the arm was kept clear of, for the one who starts the program.
std::string clear_remark(const Plan& plan) {
  return plan.clear_of.empty() ? "no obstacle was looked at" : "poses clear of " + plan.clear_of;
}

/// The six axes among the joints, and the rail.
struct Axes {
  std::vector<int> turning;
  std::optional<int> rail;
};

Result<Axes> axes_of(const Chain& robot, const ProgramOptions& options) {
  Axes axes;
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type == JointType::kRevolute) {
      axes.turning.push_back(j);
    } else if (!axes.rail && (j == 0 || j + 1 == robot.size())) {
      axes.rail = j;
    } else {
      return refused("robot {}: joint {} is prismatic", robot.name(), j + 1)
          .of(fmt::format("joint {}", j + 1))
          .next("a program holds six turning axes and one rail before or after");
    }
  }
  if (axes.turning.size() != 6) {
    return refused("robot {}: {} turning joints, a program holds 6 and one rail", robot.name(),
                   axes.turning.size())
        .of("joints")
        .beyond(axes.turning.size(), 6);
  }
  if (!(options.wait_s >= 0 && std::isfinite(options.wait_s))) {
    return refused("a wait of {} s at each pose", options.wait_s)
        .of("wait_s")
        .beyond(options.wait_s, 0)
        .next("expected 0 or more");
  }
  return axes;
}

/// Four decimals without trailing zeros; never `-0`.
std::string number(double value) {
  std::string text = fmt::format("{:.4f}", value);
  if (text.find_first_not_of("-0.") == std::string::npos) return "0";
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// The tool and payload to mount before this pose; empty where they are mounted already.
std::string change_before(const Plan& plan, std::size_t i) {
  const PoseContext& now = plan.poses[i].context;
  if (i == 0) return "";
  const PoseContext& before = plan.poses[i - 1].context;
  if (before.tool == now.tool && before.payload == now.payload) return "";
  return fmt::format("now tool {}, payload {}", now.tool,
                     now.payload.empty() ? "none" : now.payload);
}

std::string rapid_target(const std::string& name, const Axes& axes, const JointVector& q) {
  std::vector<std::string> degrees;
  for (const int j : axes.turning) degrees.push_back(number(to_deg(q(j))));
  const std::string rail = axes.rail ? number(to_mm(q(*axes.rail))) : "9E9";
  return fmt::format("  CONST jointtarget {}:=\n    [[{}],\n    [{},9E9,9E9,9E9,9E9,9E9]];\n", name,
                     fmt::join(degrees, ","), rail);
}

std::string krl_motion(const Axes& axes, const JointVector& q) {
  std::vector<std::string> values;
  for (std::size_t k = 0; k < axes.turning.size(); ++k) {
    values.push_back(fmt::format("A{} {}", k + 1, number(to_deg(q(axes.turning[k])))));
  }
  if (axes.rail) values.push_back("E1 " + number(to_mm(q(*axes.rail))));
  return fmt::format("  PTP {{{}}}\n", fmt::join(values, ","));
}

/// Instructions and positions of a TP program; lines are numbered.
class FanucText {
 public:
  FanucText(const Axes& axes, int tool) : axes_(axes), tool_(tool) {}

  void line(const std::string& instruction) {
    lines_ += fmt::format("{:4}:  {} ;\n", ++count_, instruction);
  }
  void remark(const std::string& text) { line(comment("!", text).substr(0, kFanucRemark)); }
  void move(const JointVector& q, int percent) {
    // The motion type stands where other instructions have a blank.
    lines_ += fmt::format("{:4}:J P[{}] {}% FINE ;\n", ++count_, ++position_, percent);
    positions_ += fmt::format("P[{}]{{\n   GP1:\n\tUF : 0, UT : {},\t\n", position_, tool_);
    std::vector<std::string> values;
    for (std::size_t k = 0; k < axes_.turning.size(); ++k)
      values.push_back(
          fmt::format("\tJ{}= {:10.4f} deg", k + 1, to_deg(q(axes_.turning[k])) + 0.0));
    if (axes_.rail)
      values.push_back(fmt::format("\tE1= {:10.4f}  mm", to_mm(q(*axes_.rail)) + 0.0));
    positions_ += fmt::format("{}\n}};\n", fmt::join(values, ",\n"));
  }
  [[nodiscard]] std::string text(const std::string& name) const {
    return fmt::format(
        "/PROG  {}\n/ATTR\nOWNER\t\t= MNEDITOR;\nCOMMENT\t\t= \"measuring poses\";\nLINE_COUNT\t= "
        "{};\n"
        "PROTECT\t\t= READ_WRITE;\nDEFAULT_GROUP\t= 1,*,*,*,*;\n/MN\n{}/POS\n{}/END\n",
        name, count_, lines_, positions_);
  }

 private:
  const Axes& axes_;
  const int tool_;
  std::string lines_, positions_;
  int count_ = 0, position_ = 0;
};

std::string script_motion(const Axes& axes, const JointVector& q, double speed) {
  std::vector<std::string> values;
  for (const int j : axes.turning) values.push_back(fmt::format("{:.8f}", q(j) + 0.0));
  return fmt::format("  movej([{}], a={:g}, v={:g})\n", fmt::join(values, ", "), 3 * speed, speed);
}

}  // namespace

Result<std::string> to_rapid(const Chain& robot, const Plan& plan, const ProgramOptions& options) {
  const Axes axes = TRY(axes_of(robot, options));
  if (!is_name(options.rapid_tool, kRapidName)) {
    return refused("RAPID tool '{}': expected a letter, then letters, digits or '_', {} at most",
                   options.rapid_tool, kRapidName)
        .of("rapid_tool")
        .with_text(options.rapid_tool);
  }
  std::string text = fmt::format("MODULE {}\n", module_name(options.name));
  text +=
      "  " + comment("!", fmt::format("{} poses for {}", plan.poses.size(), robot.name())) + "\n";
  text += "  " + comment("!", clear_remark(plan)) + "\n";
  text += fmt::format("  CONST num trammel_wait:={:g};\n", options.wait_s);
  text += "  CONST speeddata trammel_fast:=[200,20,200,20];\n";
  text += "  CONST speeddata trammel_slow:=[20,2,20,2];\n";
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    text += rapid_target(fmt::format("trammel_b{}", i + 1), axes, plan.poses[i].bump);
    text += rapid_target(fmt::format("trammel_p{}", i + 1), axes, plan.poses[i].context.q);
  }
  text += "\n  PROC trammel_measure()\n";
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    if (const std::string change = change_before(plan, i); !change.empty()) {
      text += "    " + comment("!", change) + "\n    Stop;\n";
    }
    text += "    " + comment("!", "pose " + plan.poses[i].id) + "\n";
    text += fmt::format("    MoveAbsJ trammel_b{}\\NoEOffs,trammel_fast,fine,{};\n", i + 1,
                        options.rapid_tool);
    text += fmt::format("    MoveAbsJ trammel_p{}\\NoEOffs,trammel_slow,fine,{};\n", i + 1,
                        options.rapid_tool);
    text += "    WaitTime \\InPos,trammel_wait;\n";
  }
  return text + "  ENDPROC\nENDMODULE\n";
}

Result<std::string> to_krl(const Chain& robot, const Plan& plan, const ProgramOptions& options) {
  const Axes axes = TRY(axes_of(robot, options));
  if (options.krl_tool < 0 || options.krl_tool > kKrlTools) {
    return refused("KRL tool {}: expected 0 to {}", options.krl_tool, kKrlTools)
        .of("krl_tool")
        .beyond(options.krl_tool, options.krl_tool < 0 ? 0 : kKrlTools);
  }
  if (!is_name(options.name, kKrlName)) {
    return refused(
               "KRL program '{}': expected a letter, then letters, digits or '_', {} at most, as "
               "its file is named",
               options.name, kKrlName)
        .of("program")
        .with_text(options.name);
  }
  std::string text = fmt::format("&ACCESS RVP\n&REL 1\nDEF {} ( )\n", options.name);
  text +=
      "  " + comment(";", fmt::format("{} poses for {}", plan.poses.size(), robot.name())) + "\n";
  text += "  " + comment(";", clear_remark(plan)) + "\n";
  text += "  EXT BAS (BAS_COMMAND :IN,REAL :IN)\n";
  text += "  DECL REAL TRAMMEL_WAIT\n";
  text += "  BAS (#INITMOV,0)\n";
  text += fmt::format("  BAS (#TOOL,{})\n", options.krl_tool);
  text += "  BAS (#BASE,0)\n";
  text += "  BAS (#ACC_PTP,20)\n";
  text += fmt::format("  TRAMMEL_WAIT={:g}\n", options.wait_s);
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    if (const std::string change = change_before(plan, i); !change.empty()) {
      text += "  " + comment(";", change) + "\n  HALT\n";
    }
    text += "  " + comment(";", "pose " + plan.poses[i].id) + "\n";
    text += "  BAS (#VEL_PTP,20)\n" + krl_motion(axes, plan.poses[i].bump);
    text += "  BAS (#VEL_PTP,2)\n" + krl_motion(axes, plan.poses[i].context.q);
    text += "  WAIT SEC TRAMMEL_WAIT\n";
  }
  return text + "END\n";
}

Result<std::string> to_fanuc(const Chain& robot, const Plan& plan, const ProgramOptions& options) {
  const Axes axes = TRY(axes_of(robot, options));
  if (options.fanuc_tool < 1 || options.fanuc_tool > kFanucTools) {
    return refused("FANUC tool {}: expected 1 to {}", options.fanuc_tool, kFanucTools)
        .of("fanuc_tool")
        .beyond(options.fanuc_tool, options.fanuc_tool < 1 ? 1 : kFanucTools);
  }
  if (!is_name(options.name, kFanucName)) {
    return refused("TP program '{}': expected a letter, then letters, digits or '_', {} at most",
                   options.name, kFanucName)
        .of("program")
        .with_text(options.name);
  }
  FanucText text(axes, options.fanuc_tool);
  text.remark(fmt::format("{} poses for {}", plan.poses.size(), robot.name()));
  text.remark(clear_remark(plan));
  text.line("UFRAME_NUM=0");
  text.line(fmt::format("UTOOL_NUM={}", options.fanuc_tool));
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    if (const std::string change = change_before(plan, i); !change.empty()) {
      text.remark(change);
      text.line("PAUSE");
    }
    text.remark("pose " + plan.poses[i].id);
    text.move(plan.poses[i].bump, 20);
    text.move(plan.poses[i].context.q, 2);
    text.line(fmt::format("WAIT {:6.2f}(sec)", options.wait_s));
  }
  return text.text(upper(options.name));
}

Result<std::string> to_urscript(const Chain& robot, const Plan& plan,
                                const ProgramOptions& options) {
  const Axes axes = TRY(axes_of(robot, options));
  if (axes.rail)
    return refused("robot {}: joint {} is prismatic, a script moves six turning joints",
                   robot.name(), *axes.rail + 1)
        .of(fmt::format("joint {}", *axes.rail + 1));
  constexpr double kFast = 0.35, kSlow = 0.035;  // rad/s
  const std::string name = module_name(options.name);
  std::string text =
      fmt::format("def {}():\n  {}\n  {}\n", name,
                  comment("#", fmt::format("{} poses for {}", plan.poses.size(), robot.name())),
                  comment("#", clear_remark(plan)));
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    if (const std::string change = change_before(plan, i); !change.empty()) {
      text += fmt::format("  popup(\"{}\", blocking=True)\n", comment("", change).substr(1));
    }
    text += "  " + comment("#", "pose " + plan.poses[i].id) + "\n";
    text += script_motion(axes, plan.poses[i].bump, kFast);
    text += script_motion(axes, plan.poses[i].context.q, kSlow);
    text += fmt::format("  sleep({:g})\n", options.wait_s);
  }
  return text + fmt::format("end\n{}()\n", name);
}

}  // namespace trammel

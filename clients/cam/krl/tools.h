#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/variables.h"
#include "clients/cam/program.h"

/// Tools, bases and loads of a KRL program, as its lines name them.
namespace trammel::cam::krl {

/// The value that `$LOAD` was set to.
struct Load {
  std::string name;
  std::optional<StatedLoad> load;
  std::string note, why_not;
};

class Tools {
 public:
  Tools(const std::vector<std::vector<Line>>& lines, const Variables& names,
        const ReadOptions& options, Program& program)
      : lines_(lines), names_(names), options_(options), program_(program) {}

  /// `;FOLD PTP P1 ... Tool[1]:spindle Base[2]:panel;...`
  void note_tool_name(const Line& line);
  std::size_t add_tool(ProgramTool tool);
  std::size_t add_frame(ProgramFrame frame);
  /// `$TOOL`, `$BASE`, `$LOAD` where they are not known.
  std::size_t unknown_tool(const std::string& why);
  std::size_t unknown_base(const std::string& why);
  std::size_t unknown_load(const std::string& why);
  std::size_t tool_numbered(int number, std::size_t f);
  std::size_t base_numbered(int number, std::size_t f);
  /// `$TOOL = ...`
  std::size_t tool_set(const std::vector<Value>& operands, std::size_t f, std::size_t k);
  /// `$BASE = ...`
  std::size_t base_set(const std::vector<Value>& operands, std::size_t f);
  std::size_t add_load(Load load);
  /// `$LOAD = ...`
  std::size_t load_set(const std::vector<Value>& operands, std::size_t f, std::size_t k);
  /// The tool as a motion has it.
  std::size_t tool_carrying(std::size_t tool, std::size_t index);
  /// Why a load is not known; empty: it is.
  [[nodiscard]] const std::string& why_not(std::size_t load) const { return loads_[load].why_not; }

 private:
  [[nodiscard]] std::string against_row(const std::string& row, const Pose& X,
                                        const Told<Pose>& by_files, const Assigned& at) const;
  void fill(const Assigned& assigned, ProgramTool& tool) const;
  static std::optional<StatedLoad> load_of(const std::vector<Value>& operands);
  [[nodiscard]] std::string note_on_default(const std::optional<StatedLoad>& load,
                                            const Assigned& at) const;
  [[nodiscard]] std::string carried(int number, std::size_t f) const;
  [[nodiscard]] std::string carried_by(const std::vector<Value>& operands, std::size_t f,
                                       int depth = 0) const;
  [[nodiscard]] bool is_unit(const Value* index, std::size_t f) const;

  const std::vector<std::vector<Line>>& lines_;
  const Variables& names_;
  const ReadOptions& options_;
  Program& program_;
  std::map<std::string, std::string> tool_names_;
  std::vector<Load> loads_ = std::vector<Load>(1);  ///< 0: the tool's own
};

}  // namespace trammel::cam::krl

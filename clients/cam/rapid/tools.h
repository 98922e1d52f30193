#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"
#include "clients/cam/rapid/interpreter.h"

/// Tools, work objects and loads of a RAPID program, as its motions name them.
namespace trammel::cam::rapid {

class Tools {
 public:
  /// Adds tools and frames to those of `program`; frame 0 is wobj0.
  Tools(Interpreter& meaning, const ReadOptions& options, Program& program);

  /// The index in Program::tools of the tool that an argument names.
  std::size_t tool_of(const Expression& argument, const Scope& scope);
  /// The index in Program::frames of the frame that an argument names; nullptr: wobj0.
  std::size_t frame_of(const Expression* argument, const Scope& scope);
  /// The load that `GripLoad lPart;` sets beside the tool's own; 0: none.
  std::size_t load_set(std::size_t module, const Instruction& instruction);
  /// Marks a load as unknown, with this reason; a load that is unknown already stays.
  std::size_t undecided_load(std::size_t load, const std::string& why);
  /// The tool with its load: `\TLoad` is the total load; otherwise `gripped` is added to the tool's
  /// own.
  std::size_t tool_carrying(std::size_t tool, std::size_t gripped, const Instruction& motion,
                            const Scope& scope);

  /// The tool as a module declares it, with or without motions that use it.
  [[nodiscard]] ProgramTool declared_tool(const Data& data) const;
  [[nodiscard]] ProgramFrame declared_frame(const Data& data) const;
  [[nodiscard]] std::optional<StatedLoad> load_of(const Data& data) const;

 private:
  struct Load {
    std::string name;
    std::optional<StatedLoad> load;
    std::string note, why_not;
    bool total = false;  ///< with the tool's own
    bool operator==(const Load& other) const;
  };

  std::size_t known_tool(ProgramTool tool);
  /// The aggregate of `parts` parts that `of` is or stands for. `of` is a part of a tool or of a
  /// work object.
  [[nodiscard]] Told<Data> aggregate(const Data& of, std::size_t parts) const;
  [[nodiscard]] Told<Pose> pose(const Data& of, int* rotation_decimals) const;
  [[nodiscard]] Told<bool> truth(const Data& of) const;
  /// The data of a tool or work object that an argument names; an error if the files do not have
  /// it.
  [[nodiscard]] Told<Data> named(const Expression& argument, const Scope& scope) const;
  void read_tool(const Data& data, ProgramTool& tool) const;
  void read_frame(const Data& parts, ProgramFrame& frame) const;
  std::size_t known_load(Load load);
  [[nodiscard]] Load load_called(const Expression& argument, const Scope& scope) const;

  Interpreter& meaning_;
  const ReadOptions& options_;
  Program& program_;
  std::vector<Load> loads_ = std::vector<Load>(1);
  std::map<const Expression*, std::size_t> tool_at_,
      frame_at_;  ///< of Program::tools and frames, by the expressions that name them
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> carrying_;
};

}  // namespace trammel::cam::rapid

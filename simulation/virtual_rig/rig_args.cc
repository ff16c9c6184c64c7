#include "simulation/virtual_rig/rig_args.h"

#include <CLI/CLI.hpp>
#include <map>

namespace sateen {
namespace {

constexpr const char* kFooter =
    "Without a command it runs until Ctrl-C, prints what happens as JSON lines, and reads "
    "commands\n"
    "from standard input, a line each, until `quit`:\n"
    "  reset, unplug, plug, brown-out [MS], flash [MS]   the board\n"
    "  scene DIR                   another object under the camera\n"
    "  camera FAULT [N]            the next N captures go wrong: busy, no-event, late-event, "
    "gone,\n"
    "                              dropped-mid-file, short-transfer, truncated-file, card-full,\n"
    "                              asleep, wrong-exposure, two-files; `camera wake` ends asleep\n"
    "  ambient FACTOR              times the scene's ambient light\n"
    "  nudge DX DY                 the picture moves by so many pixels to the right and down\n"
    "  swap A B, double A B        two lights' wiring; A also lights B\n"
    "  light K FACTOR              a light gives so much of its light; 0: dead\n"
    "  shade X Y RADIUS FACTOR [N] a disc of the picture is darker in the next N frames\n"
    "A light is named as in the rig, or by its channel. The first event holds the environment in\n"
    "which another shell starts programs that find board and camera. Or start both at once:\n"
    "  sateen-virtual-rig run --rig samples/rigs/ring10.json -- sateen light 3 --level 50%\n"
    "  sateen simulate samples/scenes/twill-small.json --linear -o twill\n"
    "  sateen-virtual-rig run --scene twill -- sateen devices\n"
    "Exit status: as that of sateen; with `run` that of the command.";

// Adds options that may come before the subcommand or after it.
void AddOptions(CLI::App& app, RigArgs& args) {
  app.add_option("--rig", args.rig, "Rig file; names the lights in the events");
  app.add_option("--lights", args.lights, "Lights of the board, 14 or 16")
      ->check(CLI::IsMember({14, 16}))
      ->capture_default_str();
  app.add_option("--firmware", args.firmware,
                 "Firmware image to run, ELF or Intel HEX; default: ours for as many lights");
  app.add_flag("--opening-resets", args.opening_resets,
               "Opening the port resets the board for 1 s, as it does an Arduino Uno");
  app.add_option("--events", args.events, "Write what happens to this file, as JSON lines");
  app.add_option("--fault", args.faults,
                 "Do this command, as from standard input, at the start; may be repeated")
      ->option_text("COMMAND ...")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);  // or it would take the -- before the command
  RigCameraOptions& camera = args.camera;
  app.add_option("--scene", camera.scene,
                 "A camera that sees this scene, lit by the board: a session that\n"
                 "`sateen simulate SCENE --linear` has written");
  app.add_option("--camera", camera.persona, "What the camera gives itself out for")
      ->check(CLI::IsMember({"generic", "nikon"}))
      ->capture_default_str();
  app.add_option("--sensor", camera.sensor,
                 "Its sensor; default: by the response of the scene's rig, else nikon-d5100");
  app.add_option("--black", camera.black_dn, "What the sensor reads in the dark [DN]");
  app.add_option("--full-scale", camera.full_scale,
                 "Radiance that reads as white at 1/50 s, f/8, ISO 100")
      ->capture_default_str();
  app.add_option("--ambient", camera.ambient, "Ambient light, times that of the scene")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_option_function<double>(
         "--rise",
         [&camera](double ms) {
           camera.rise = std::chrono::nanoseconds(static_cast<int64_t>(ms * 1e6));
         },
         "Time constant of a light's going on and off [ms]; default: 1")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--at", args.scheduled,
                 "Do a command when the Nth capture is asked for, or some time\n"
                 "after that: '5:nudge 3 0', '5+12ms:unplug'; may be repeated")
      ->option_text("N[+TIME]:COMMAND ...")
      ->expected(1)
      ->take_all()
      ->allow_extra_args(false);  // or it would take the -- before the command
}

// Options that say something about a camera that is not there.
void RequireScene(const CLI::App& app, const CLI::App& run, const RigArgs& args) {
  if (!args.camera.scene.empty()) {
    return;
  }
  for (const char* name :
       {"--camera", "--sensor", "--black", "--full-scale", "--ambient", "--rise", "--at"}) {
    if (app.count(name) + run.count(name) > 0) {
      throw CLI::RequiredError(std::string(name) + ": there is no camera without a scene; --scene");
    }
  }
}

}  // namespace

std::optional<int> ParseRigArgs(int argc, char** argv, RigArgs& args) {
  CLI::App app(
      "A rig without hardware: the LED board's own firmware in a simulated ATmega328P, in real "
      "time, with its\nserial line on a pseudo terminal; and with --scene a camera on PTP/IP that "
      "sees what the board lights.",
      "sateen-virtual-rig");
  AddOptions(app, args);
  app.add_option("--port-link", args.port_link,
                 "Make this path a link to the pseudo terminal while the board is plugged in");
  CLI::App* run = app.add_subcommand(
      "run", "Start the rig, run a command that finds it as /dev/ttyACM0, and end with its status");
  AddOptions(*run, args);
  run->add_option("command", args.command, "The command and its arguments, after --")
      ->required()
      ->option_text("-- COMMAND ARGUMENTS ...");
  run->footer("The commands of --fault and --at: sateen-virtual-rig --help");
  app.footer(kFooter);
  try {
    app.parse(argc, argv);
    RequireScene(app, *run, args);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return std::nullopt;
}

}  // namespace sateen

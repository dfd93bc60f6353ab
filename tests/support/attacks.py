"""Scripts of gmsh that try to do more than draw; and, as a program, what becomes of them when nothing looks at them.

python3 attacks.py FOLDER COUNT SANDBOX: give COUNT scripts to gmsh itself as they are, each in a process of its own in
FOLDER, in the sandbox (1) or outside (0), and print as JSON what these processes had to say.
"""

import json
import os
import random
import signal
import sys
from pathlib import Path

# What each attack leaves behind if it succeeds.
LEFT, SECRET = "PWNED", "key4242"
TOUCH = f"touch {LEFT}"
COMMANDS = [
    f'System "{TOUCH}";',
    f"System '{TOUCH}';",
    f'SystemCall "{TOUCH}";',
    f'NonBlockingSystemCall "{TOUCH}";',
    f'OnelabRun("a", "{TOUCH}");',
    f'Printf("x") > "{LEFT}";',
    f'Printf("x") >> "{LEFT}";',
    f'Error("x") > "{LEFT}";',
    f'Save "{LEFT}.msh";',
    f'Print "{LEFT}.opt";',
    f'CreateDir "{LEFT}";',
    'Include "other.geo";',
    'Merge "other.geo";',
    'Merge StrCat("oth", "er.geo");',
    'Merge "other.msh";',
    f'Macro m\nSystemCall "{TOUCH}";\nReturn\nCall m;',
    f'Function m\nSystemCall "{TOUCH}";\nReturn\nCall m;',
    'x[] = ListFromFile["secret.txt"];',
    'Include "secret.txt";',
    'Merge "secret.txt";',
    f'x[] = ListFromFile["secret.txt"]; Printf("%g", x[0]) > "{LEFT}";',
    f'Parse[ Str("System", "Call \'{TOUCH}\';") ];',
    f'Field[1] = ExternalProcess; Field[1].CommandLine = "{TOUCH}"; Background Field = 1; Mesh 2;',
    'Field[1] = Structured; Field[1].FileName = "secret.txt"; Background Field = 1;',
    f'Plugin(NewView).Run; View[0].Name = "a"; Save View[0], "{LEFT}.pos";',
    f'SetName "a"; Save "{LEFT}.step";',
    f'General.ErrorFileName = "{LEFT}"; General.AbortOnError = 0; Save Options "{LEFT}";',
    f'DefineConstant[ x = {{1, Name "{LEFT}", Macro "Include \'other.geo\'"}} ];',
    f'x = GetEnv("HOME"); SystemCall StrCat("{TOUCH}", "");',
    f'Exit; SystemCall "{TOUCH}";',
    f'Delete Model; SystemCall "{TOUCH}";',
]
LONG = "a" * 1030
DISGUISES = [
    "{}",
    "General.AbortOnError = 0;\n{}",
    f'General.AbortOnError = 0;\ns = "{LONG}\n{{}}\n";',
    f"General.AbortOnError = 0;\ns = '{LONG}';\n{{}}\n//'",
    f'General.AbortOnError = 0;\nPhysical Curve("{LONG} ;") = {{{{1}}}};\n{{}}',
    "/* a */ {} /* b */",
    "/*/ */ {} //*/",
    "// a comment \\\n{}",
    "// a\r{}",
    "/* a \" */ {} /* ' */",
    'Physical Curve("\'") = {{1}}; {} Physical Curve("\'") = {{2}};',
    'Physical Curve("a) = {{1}};\n{}\n// ")',
    "If (0)\n x = 1;\nElse\n{}\nEndIf",
    "If (0) endEndIf = 1; {}\nEndIf",
    'If (0)\nPhysical Curve("EndIf\t{} ") = {{1}};\nEndIf',
    "If (0)\nMesh.EndIf{}\nEndIf",
    "For k In {{1:0}}\nEndForm = 1;\n{}\nEndFor",
    "For k In {{1:2}}\n{}\nEndFor",
    "x = ;\n{}",
    "x = 1 ){};\n{}",
    "Mesh.SizeMax = {{1, 2\n{}",
    "SystemCall = 1; System = 2; Include = 3; Merge = 4; Printf() = {{1}};\n{}",
    "x\x00\n{}",
    "\ufeff{}",
    "\u00a0{}",
    "Point(1) = {{0, 0, 0}}; Extrude {{1, 0, 0}} {{ Point{{1}}; }} {}",
]


def scripts(count, seed=20):
    """So many scripts, each with a command in a disguise or two; all pairs differ."""
    chance = random.Random(seed)
    pairs = [(command, disguise) for command in COMMANDS for disguise in DISGUISES]
    for command, disguise in chance.sample(pairs, count):
        inner = disguise.replace("{{", "\x01").replace("}}", "\x02").replace("{}", command)
        text = inner.replace("\x01", "{").replace("\x02", "}")
        if chance.random() < 0.3:
            text = f"General.AbortOnError = {chance.randrange(4)};\n{text}"
        yield f"x = {chance.randrange(9)};\n{text}\nPoint(7) = {{0, 0, 0}};\n"


def prepare(folder):
    """What the scripts refer to."""
    (folder / "other.geo").write_text(f'SystemCall "{TOUCH}";\n')
    (folder / "other.msh").write_text(f'SystemCall "{TOUCH}";\n')
    (folder / "secret.txt").write_text(f"{SECRET} 2 3\n")


def _run(folder, sandboxed, text):
    """In a process of its own: what gmsh complains about."""
    from signorini_fx.mechanics.mesh.files import gmsh_reader, sandbox

    file = folder / "script.geo"
    file.write_text(text, encoding="utf-8")
    if sandboxed:
        sandbox.confine(gmsh_reader.files_of(file))
    gmsh_reader.read(file, 0, 0, 0.0)


def main(folder, count, sandboxed):
    """Run the scripts one after the other, and say what each could do."""
    os.chdir(folder)
    from signorini_fx.mechanics.mesh.files import gmsh_reader

    gmsh_reader.load_libraries(".geo")
    found = []
    for text in scripts(count):
        with Path("said").open("w+b") as said:
            if (child := os.fork()) == 0:
                signal.alarm(20)
                os.dup2(said.fileno(), 1)
                os.dup2(said.fileno(), 2)
                try:
                    _run(folder, sandboxed, text)
                except Exception as error:
                    os.write(1, str(error).encode(errors="replace"))
                os._exit(0)
            os.waitpid(child, 0)
            said.seek(0)
            words = said.read().decode(errors="replace")
        left = sorted(path.name for path in folder.iterdir() if path.name.startswith(LEFT))
        for name in left:
            path = folder / name
            path.rmdir() if path.is_dir() else path.unlink()
        found.append({"script": text, "left": left, "read": SECRET in words})
    print(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == "1")

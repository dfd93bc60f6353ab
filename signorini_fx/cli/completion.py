"""Scripts that complete the command line in a shell, made from its grammar."""

from __future__ import annotations

import argparse

SHELLS = ("bash", "zsh", "fish")

_BASH = """_signorini_fx() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" known=""
    if ((COMP_CWORD == 1)); then
        COMPREPLY=($(compgen -W "{commands}" -- "$word"))
        return
    fi
    case "$before" in
{values}
    esac
    if [[ -z "$known" && "$word" == -* ]]; then
        case "${{COMP_WORDS[1]}}" in
{options}
        esac
    fi
    if [[ -n "$known" ]]; then
        COMPREPLY=($(compgen -W "$known" -- "$word"))
    else
        local IFS=$'\\n'
        compopt -o filenames 2>/dev/null
        COMPREPLY=($(compgen -f -- "$word"))
    fi
}}
complete -F _signorini_fx signorini-fx"""
_ZSH = """_signorini_fx() {{
    local word="${{words[CURRENT]}}" before="${{words[CURRENT-1]}}" known=""
    if ((CURRENT == 2)); then
        compadd -- {commands}
        return
    fi
    case "$before" in
{values}
    esac
    if [[ -z "$known" && "$word" == -* ]]; then
        case "${{words[2]}}" in
{options}
        esac
    fi
    if [[ -n "$known" ]]; then
        compadd -- ${{=known}}
    else
        _files
    fi
}}
(($+functions[compdef])) || {{ autoload -U compinit && compinit }}
compdef _signorini_fx signorini-fx"""


def completion_script(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script for a shell: commands, options of each command, words that options and arguments allow, and files.

    Args:
        parser: the grammar.
        shell: one of ``SHELLS``.
    """
    commands = _commands(parser)
    if shell == "fish":
        return "\n".join(_fish(commands))
    indent = " " * 8
    values = {
        name: " ".join(map(str, action.choices))
        for command in commands.values()
        for action in command._actions
        if action.choices
        for name in action.option_strings or [_name_of(command)]
    }
    options = {name: " ".join(_options(command)) for name, command in commands.items()}
    return (_ZSH if shell == "zsh" else _BASH).format(
        commands=" ".join(commands),
        values="\n".join(f'{indent}{name}) known="{words}" ;;' for name, words in values.items()),
        options="\n".join(f'{indent}    {name}) known="{words}" ;;' for name, words in options.items()),
    )


def _commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    (choices,) = (action.choices for action in parser._actions if isinstance(action.choices, dict))
    return dict(choices)


def _name_of(command: argparse.ArgumentParser) -> str:
    return command.prog.split()[-1]


def _options(command: argparse.ArgumentParser) -> list[str]:
    return [name for action in command._actions for name in action.option_strings if name.startswith("--")]


def _fish(commands: dict[str, argparse.ArgumentParser]) -> list[str]:
    lines = [f"complete -c signorini-fx -n __fish_use_subcommand -f -a {name}" for name in commands]
    for name, command in commands.items():
        seen = f"complete -c signorini-fx -n '__fish_seen_subcommand_from {name}'"
        for action in command._actions:
            words = f" -x -a '{' '.join(map(str, action.choices))}'" if action.choices else ""
            if not action.option_strings:
                lines += [seen + words] if words else []
            else:
                needed = " -r" if action.nargs != 0 and not words else ""
                lines.append(f"{seen} -l {action.option_strings[-1].lstrip('-')}{needed}{words}")
    return lines

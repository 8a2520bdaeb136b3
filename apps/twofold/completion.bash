# Completion for twofold. Commands, options and their choices come from the program's own help.
_twofold() {
  local program=${COMP_WORDS[0]} word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]}
  local command=() help names given choices
  help=$("$program" --help 2>/dev/null) || return
  for given in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    names=$(awk '/^Subcommands:/ { on = 1; next } on && NF { print $1 }' <<<"$help")
    grep -qxF -- "$given" <<<"$names" || break
    command+=("$given")
    help=$("$program" "${command[@]}" --help 2>/dev/null) || return
  done
  names=$(awk '/^Subcommands:/ { on = 1; next } on && NF { print $1 }' <<<"$help")
  choices=$(sed -nE "s/^ *${before}( [A-Z]+:|:)\{([^}]*)\}.*/\2/p" <<<"$help" | tr , ' ')
  case $before/$word in
    --*/*) [ -n "$choices" ] && mapfile -t COMPREPLY < <(compgen -W "$choices" -- "$word") && return ;;
  esac
  case $word in
    -*) mapfile -t COMPREPLY < <(compgen -W "$(grep -oE -- '^ +(-h,)?--[a-z0-9-]+' <<<"$help" | sed 's/^ *\(-h,\)\?//')" -- "$word") ;;
    *) [ -n "$names" ] && mapfile -t COMPREPLY < <(compgen -W "$names" -- "$word") ;;
  esac
}
complete -o default -F _twofold twofold

# _eventgan_options: each command's options. _eventgan_words: what "COMMAND --OPTION" takes, where these are words.

_eventgan() {
  local cur prev words cword split
  _init_completion -s || return
  local command=${words[1]}
  if [[ $cword -eq 1 || ( $command == help && $cur != -* ) ]]; then
    COMPREPLY=($(compgen -W "${!_eventgan_options[*]} --help --version" -- "$cur"))
  elif [[ -n ${_eventgan_words["$command $prev"]-} ]]; then
    COMPREPLY=($(compgen -W "${_eventgan_words["$command $prev"]}" -- "$cur"))
  elif [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W "${_eventgan_options[$command]-}" -- "$cur"))
  else
    _filedir
  fi
}
complete -F _eventgan eventgan

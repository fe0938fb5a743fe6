# shellcheck shell=sh
# Files as a hand, an editor or a broken copy leaves them, beside a sound bag `run`.
set -e
mkdir empty; : >empty.mcap; printf 'hello\n' >notes.txt
head -c 3000 run/run_0.mcap >cut.mcap
{ printf 'oops'; cat run/run_0.mcap; } >shifted.mcap
printf 'base: reference_unit\noil:\n  density_kg_m3: 870\n' >unit.yaml
printf 'base: reference_unit\noil:\n  densty_kg_m3: 870\n' >typo.yaml
printf 'base: reference_unit\noil:\n  density_kg_m3: -870\n' >sign.yaml
printf 'base: reference_unit\noil:\n  density_kg_m3: heavy\n' >word.yaml
printf 'base: reference_unit\noil:\n\tdensity_kg_m3: 870\n' >tab.yaml
printf 'base: reference_unit\noil:\n  tank_pressure_pa: {value: 63, unit: bar}\n' >bar.yaml
printf 'base: reference_unit\noil:\n  density_kg_m3: {value: 870, unit: g}\n' >gram.yaml
printf 'base: reference_unit\noil:\n  density_kg_m3: 870\n  density_kg_m3: 880\n' >twice.yaml
printf 'base: nowhere.yaml\n' >orphan.yaml
printf 'base: loop.yaml\n' >loop.yaml
printf 'a: &a [1]\nb: [*a,*a,*a,*a,*a,*a,*a,*a,*a,*a,*a]\n' >alias.yaml
printf 'base: reference_unit\nwrong: 1\nalso_wrong: 2\n' >two.yaml
printf 'base: reference_unit\noil:\n  density_kg_m3: .nan\n' >nan.yaml
printf 'base: reference_unit\noil:\n  density_kg_m3: 1e999\n' >huge.yaml
printf '\377\376b\0a\0' >utf16.yaml
printf '{}' >report.json; printf '{"schema":' >torn.json
printf 'time,y\n0,1\n1,2\n' >table.csv; printf '' >void.csv; printf 'time;y\n0;1,5\n1;2,5\n' >comma.csv
printf '\211MCAP0\r\nabc' >stub.mcap; printf '#ROSBAG V2.0\n' >ros1.bag; printf '\0\1\2\3' >bin.dat
ln -s nowhere dangling; mkfifo pipe
mkdir circle; cp -r run circle/; ln -s . circle/again
# Reports from strangers: edited, cut, of another version, or of another editor.
made='"schema":"govtwin-diagnosis/1"'
printf '{"schema":"govtwin-diagnosis/2"}' >later.json; printf '[]' >list.json; printf '%0200d' 0 | tr 0 '[' >nested.json
printf '{%s,"verdict":"no_gap","ranking":[{"id":"none","probability":0.97}]}' "$made" >odds.json
printf '{%s,"verdict":"unknown","location":{"stage":"turbine"}}' "$made" >turbine.json
printf '{%s,"verdict":"all is well"}' "$made" >well.json
digest() { printf '"%s"' "$1" | sha256sum | cut -c1-64; }
digests=$(printf '"schema":"%s","verdict":"%s"' "$(digest govtwin-diagnosis/1)" "$(digest no_gap)")
printf '\357\273\277{%s,"verdict":"no_gap","digests":{%s}}' "$made" "$digests" >bom.json
printf '{%s,"verdict":"unknown","digests":{%s}}' "$made" "$digests" >changed.json
printf 'main_ports:\n  overlap_m: {value: 0.2, unit: inch}\n' >inch.yaml
printf 'oil:\n  density_kg_m3: 870 kg/m3\n' >suffix.yaml
printf 'effects:\n  backlash: {play_pu: 0.3 %%}\n' >percent.yaml
printf 'oil:\n  bulk_modulus_pa: {value: 1.1, unit: gpa}\n' >gpa.yaml

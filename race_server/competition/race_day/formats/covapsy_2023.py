"""The event of April 2023: two qualifications whose times add up, then races by that order.

Source: Reglement_CourseVoituresAutonomes.md of github.com/ajuton-ens/
CourseVoituresAutonomesSaclay as of 2023. Laps of the races: our choice, as in 2025.
"""

from race_server.competition.race_day.formats.format import Format, Obstacles, Races, TimeTrial

FORMAT = Format(
    name="2023",
    title="CoVAPSy 2023",
    stages=(
        TimeTrial("Qualification 1", track="A"),
        TimeTrial("Qualification 2", track="B", obstacles=Obstacles()),
        Races("Race", tracks="B", laps=5, most=6),
    ),
)

/PROG  JOINTS
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "panel";
PROG_SIZE	= 612;
CREATE		= DATE 26-11-22  TIME 10:31:04;
LINE_COUNT	= 4;
DEFAULT_GROUP	= 1,*,*,*,*;
/APPL
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
   3:J P[1] 50% FINE     ;
   4:J P[2] 50% FINE     ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,
	J1=      .000 deg,	J2=   -20.000 deg,	J3=    20.000 deg,
	J4=      .000 deg,	J5=    30.000 deg,	J6=      .000 deg
};
P[2]{
   GP1:
	UF : 1, UT : 1,
	J1=     5.000 deg,	J2=   -20.000 deg,	J3=    20.000 deg,
	J4=      .000 deg,	J5=    30.000 deg,	J6=      .000 deg
};
/END
